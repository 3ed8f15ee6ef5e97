"""Which errors of a regression problem count, and how much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Problem

__all__ = ["Told", "View"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Told:
    """Inertial combinations that runs in closed loop tell, which know more of them than a regression.

    Attributes:
        values: shape (B,), or more where runs see more of them (`InertialBasis.faint`).
        covariance: of these.
    """

    values: Array
    covariance: Array


@dataclass(frozen=True)
class View:
    """Which errors count, and how much.

    Attributes:
        scale: shape (n,); errors are divided by it.
        rows: which rows are fitted, shape (R,).
        reversals: whether rows around quick reversals count. They hold much of what is known of dry
            friction at low speed, but also the filter's own error, so that nothing is named by them.
        prior: inverse variance, in weighted units, of each inertial combination about its nominal value.
        rougher: how many times as large as others errors around reversals are taken to be, shape (n,).
        told: the inertial combinations where runs tell them: they stay as they are.
    """

    scale: Array
    rows: NDArray[np.bool_]
    reversals: bool = False
    prior: float = 0.0
    rougher: Array | None = None
    told: Told | None = None

    def weight(self, problem: Problem) -> Array:
        """What each row counts, 0 or 1, or less than 1 around reversals, shape (R, n)."""
        if not self.reversals or self.rougher is None:
            return problem.moving if self.reversals else problem.sliding
        return np.asarray(problem.sliding + (problem.moving - problem.sliding) / self.rougher)

    def known(self, problem: Problem) -> Array:
        """Torques of the inertial combinations that runs tell, shape (R, n)."""
        if self.told is None:
            return np.zeros(problem.residual.shape)
        count = problem.nuisance.shape[2]  # what runs alone see moves no torque that shows
        return np.asarray(problem.nuisance @ self.told.values[:count])

    def flatten(self, problem: Problem, values: Array) -> Array:
        """Weighted rows of (R, n, k) for the usable joints, shape (R', k), time-major."""
        counted = values / self.scale[None, :, None] * self.weight(problem)[:, :, None]
        kept = counted[self.rows][:, problem.usable]
        return np.asarray(kept.reshape(kept.shape[0] * kept.shape[1], values.shape[2]))

    def aside(self, problem: Problem) -> Array:
        """Weighted energy of the noise that drives no actuator, per usable joint."""
        flat = self.flatten(problem, problem.aside[:, :, None])
        return np.asarray((flat.reshape(-1, int(problem.usable.sum())) ** 2).sum(0))

    def blocks(self, problem: Problem) -> NDArray[np.int_]:
        """Block of each flattened row."""
        return np.repeat(problem.blocks[self.rows], int(problem.usable.sum()))
