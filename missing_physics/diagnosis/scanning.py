"""What columns promise that are tried by the hundred: their fall of the residual, all else fitted anew."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.explanation import Explanation

__all__ = ["Scan"]

Array = NDArray[np.float64]

#: Keeps ratios of energies finite.
TINY = 1e-300
#: Two columns are no more alike than this part of their lengths' squares leaves.
SINGULAR = 1e-6


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

    @property
    def errors(self) -> Array:
        """What is left, shape (R',)."""
        return self._errors

    def promise(self, fall: float) -> float:
        """Evidence that a fall of the energy of all joints together is worth, if all feel it alike."""
        energy = max(float(self._explanation.energies.sum()), TINY)
        left = max(energy - fall, 1e-9 * energy)
        return 0.5 * float(self._explanation.effective.sum() * np.log(energy / left))

    def beside(self, torques: Array) -> Array:
        """What torques (R, n, K) add that nothing fitted can do as well, shape (R', K)."""
        columns = self._columns(torques)
        return columns - self._fitted @ (self._fitted.T @ columns)

    def of(self, torques: Array) -> tuple[Array, Array]:
        """Each column by itself.

        Args:
            torques: what each adds to the joints' torques, shape (R, n, K).

        Returns:
            Evidence that it promises and the multiple of it that fits best, shape (K,) each.
        """
        count, explanation = torques.shape[2], self._explanation
        columns = self.beside(torques)
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

    def pairs(self, one: Array, other: Array) -> tuple[Array, Array, Array]:
        """Each column of one kind beside each of another, as `roughly`.

        Args:
            one, other: shapes (R, n, I) and (R, n, J).

        Returns:
            Fall of the energy and the multiples of both that fit best, shape (I, J) each.
        """
        columns = [self.beside(torques) for torques in (one, other)]
        a, b = (part.T @ self._errors for part in columns)
        p, q = (np.maximum((part**2).sum(0), TINY) for part in columns)
        common = columns[0].T @ columns[1]
        gap = np.maximum(p[:, None] * q - common**2, SINGULAR * p[:, None] * q)
        first = (a[:, None] * q - common * b) / gap
        second = (p[:, None] * b - common * a[:, None]) / gap
        return first * a[:, None] + second * b, first, second

    def _columns(self, torques: Array) -> Array:
        problem = self._explanation.problem
        joints, count = torques.shape[1:]
        used = problem.usable[:joints]
        full = np.zeros((len(torques), len(problem.outputs), count))
        full[:, :joints][:, used] = torques[:, used]
        return self._explanation.view.flatten(problem, full)
