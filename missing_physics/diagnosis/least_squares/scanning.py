"""What columns promise that are tried by the hundred: their fall of the residual, all else fitted anew."""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.statistics.correlated_errors import NOTHING

__all__ = ["RIGID_ONLY", "Scan"]

Array = NDArray[np.float64]

#: Where alone bends, walls and mounts are looked for: what links that bend add is not tried by the hundred.
RIGID_ONLY = "only where no link is described as flexible"
#: Keeps ratios of energies finite.
TINY = 1e-300
#: A pulse of which less than this part is beside what is fitted says nothing.
NEW = 1e-6
#: Two columns are no more alike than this part of their lengths' squares leaves.
SINGULAR = 1e-6


class Scan:
    """The residual of an explanation, beside everything that is fitted in it."""

    def __init__(self, explanation: Explanation) -> None:
        self._explanation = explanation
        problem = explanation.problem
        self._width = int(problem.usable.sum())
        columns = explanation.columns[:, np.linalg.norm(explanation.columns, axis=0) > NOTHING]
        self._fitted, _ = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))
        errors = explanation.errors[:, 0]
        self._errors = errors - self._fitted @ (self._fitted.T @ errors)
        self._cost = 0.0

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
        return 0.5 * explanation.effective @ fall - self._cost, amplitude

    def roughly(self, torques: Array) -> tuple[Array, Array]:
        """The same with the fall of the energy of all joints together, for a third of the work."""
        columns = self._columns(torques)
        along = columns.T @ self._errors
        size = np.maximum((columns**2).sum(0) - ((self._fitted.T @ columns) ** 2).sum(0), TINY)
        return along**2 / size, along / size

    def freed(self, torques: Array) -> Scan:
        """The same with further columns (R, n, K) that are fitted, and what they cost."""
        more = copy(self)
        columns = self.beside(torques)
        size = np.linalg.norm(columns, axis=0)
        basis, _ = np.linalg.qr(columns[:, size > NOTHING] / size[size > NOTHING])
        more._fitted = np.column_stack([self._fitted, basis])
        more._errors = self._errors - basis @ (basis.T @ self._errors)
        more._cost = 0.5 * basis.shape[1] * float(np.log(max(self._explanation.effective.sum(), 2.0)))
        return more

    def pairs(self, one: Array, other: Array) -> tuple[Array, Array, Array]:
        """Each group of columns of one kind beside each of another, by the energy of all joints together.

        Args:
            one, other: shapes (R, n, I, a) and (R, n, J, b).

        Returns:
            Fall of the energy and the multiples of both groups' first columns, shape (I, J) each.
        """
        parts = [self.beside(part.reshape(*part.shape[:2], -1)) for part in (one, other)]
        (i, a), (j, b) = one.shape[2:], other.shape[2:]
        columns = np.concatenate(parts, axis=1)
        size = np.linalg.norm(columns, axis=0)
        per_size = np.divide(1.0, size, out=np.zeros_like(size), where=size > NOTHING)
        columns = columns * per_size
        gram, along = columns.T @ columns + SINGULAR * np.eye(columns.shape[1]), columns.T @ self._errors
        first = np.arange(i)[:, None, None] * a + np.arange(a)
        second = i * a + np.arange(j)[None, :, None] * b + np.arange(b)
        places = np.concatenate(
            [np.broadcast_to(first, (i, j, a)), np.broadcast_to(second, (i, j, b))], axis=2
        )
        moment = along[places]
        solved = np.linalg.solve(gram[places[..., :, None], places[..., None, :]], moment[..., None])[..., 0]
        return (
            (solved * moment).sum(2),
            solved[..., 0] * per_size[places[..., 0]],
            solved[..., a] * per_size[places[..., a]],
        )

    def pulses(self, output: int, edges: Array) -> Array:
        """A constant between two of these instants, for every pair of them, at one output.

        Args:
            output: index among the problem's.
            edges: instants [s], shape (K,).

        Returns:
            Fall of the energy of all joints together, shape (K, K), by first and last instant; zero where
            the last is not the later one, and at an output that is not known.
        """
        problem, view = self._explanation.problem, self._explanation.view
        if not problem.usable[output]:  # its torque is not known
            return np.zeros((edges.size, edges.size))
        place = int(problem.usable[:output].sum())
        weight = view.weight(problem)[view.rows][:, output] / view.scale[output]
        steps = (problem.time[view.rows][:, None] >= edges) * weight[:, None]
        fitted = self._fitted.reshape(len(steps), self._width, -1)[:, place]
        inner = fitted.T @ steps
        plain = steps.T @ steps
        gram = plain - inner.T @ inner
        along = steps.T @ self._errors.reshape(-1, self._width)[:, place]
        own = np.diagonal(gram)
        size = own[:, None] + own - 2.0 * gram
        # relative to the constant itself: a step that is all fitted already has nothing of its own
        whole = np.diagonal(plain)
        told = np.triu(size > NEW * np.maximum(whole[:, None], whole), 1)
        return np.where(told, (along[:, None] - along) ** 2 / np.where(told, size, 1.0), 0.0)

    def _columns(self, torques: Array) -> Array:
        problem = self._explanation.problem
        joints, count = torques.shape[1:]
        used = problem.usable[:joints]
        full = np.zeros((len(torques), len(problem.outputs), count))
        full[:, :joints][:, used] = torques[:, used]
        return self._explanation.view.flatten(problem, full)
