"""What columns promise that are tried by the hundred: their fall of the residual, all else fitted anew."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.explanation import Explanation

__all__ = ["Scan"]

Array = NDArray[np.float64]

#: Keeps ratios of energies finite.
TINY = 1e-300


class Scan:
    """The residual of an explanation, beside everything that is fitted in it."""

    def __init__(self, explanation: Explanation) -> None:
        self._explanation = explanation
        problem = explanation.problem
        self._width = int(problem.usable.sum())
        columns = explanation.columns[:, np.linalg.norm(explanation.columns, axis=0) > 0]
        self._fitted, _ = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))
        errors = explanation.errors[:, 0]
        self._errors = errors - self._fitted @ (self._fitted.T @ errors)

    def of(self, torques: Array) -> tuple[Array, Array]:
        """Each column by itself.

        Args:
            torques: what each adds to the joints' torques, shape (R, n, K).

        Returns:
            Evidence that it promises and the multiple of it that fits best, shape (K,) each.
        """
        count, explanation = torques.shape[2], self._explanation
        columns = self._columns(torques)
        columns -= self._fitted @ (self._fitted.T @ columns)
        size = np.maximum((columns**2).sum(0), TINY)
        amplitude = columns.T @ self._errors / size
        left = self._errors[:, None] - columns * amplitude
        after = (left.reshape(-1, self._width, count) ** 2).sum(0)
        fall = np.log(np.maximum(explanation.energies[:, None], TINY) / np.maximum(after, TINY))
        return 0.5 * explanation.effective @ fall, amplitude

    def roughly(self, torques: Array) -> tuple[Array, Array]:
        """The same with the fall of the energy of all joints together, for a third of the work."""
        columns = self._columns(torques)
        along = columns.T @ self._errors
        size = np.maximum((columns**2).sum(0) - ((self._fitted.T @ columns) ** 2).sum(0), TINY)
        return along**2 / size, along / size

    def _columns(self, torques: Array) -> Array:
        problem = self._explanation.problem
        joints, count = torques.shape[1:]
        used = problem.usable[:joints]
        full = np.zeros((len(torques), len(problem.outputs), count))
        full[:, :joints][:, used] = torques[:, used]
        return self._explanation.view.flatten(problem, full)
