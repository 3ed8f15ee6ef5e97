"""What share of a residual something explains beside a curve over velocity and wrong masses.

Every number is of blocks of time that were left out of the fit: one half of the blocks, every second one,
foretells the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.statistics.correlated_errors import paired_block_p_value

__all__ = ["BINS", "TOLD_SHARE", "Account", "Share", "bins", "more", "solved"]

Array = NDArray[np.float64]

#: Bins of a curve over a variable.
BINS = 24
#: A curve by itself is told when it explains this part of the residual energy in unseen blocks.
TOLD_SHARE = 0.1
#: What is told beside a curve over velocity explains this part of the energy, and of what that curve leaves.
LEAST_FURTHER, LEAST_OF_REST = 0.01, 0.25
#: Largest chance that it explains nothing, or no more than a rival.
CHANCE = 0.01
#: Ridge, as a part of the mean square of the columns.
RIDGE = 1e-6
#: Singular values below this part of the largest are none.
SINGULAR = 1e-8
#: Fewest rows that tell anything.
FEWEST_ROWS = 100


@dataclass(frozen=True)
class Share:
    """Part of the energy explained further in unseen blocks, and the energy left in each of them, (G,)."""

    share: float
    left: Array


@dataclass(frozen=True)
class Account:
    """The residual of one joint's torque in the rows of sure direction, and what explains it so far.

    Attributes:
        problem: the residual is of this one.
        joint: number of the joint.
        rows: which of the problem's rows are looked at, shape (K,).
        residual: shape (K,).
        known: columns beside which everything is fitted, shape (K, k).
    """

    problem: Problem
    joint: int
    rows: NDArray[np.int_]
    residual: Array
    known: Array

    @classmethod
    def of(cls, problem: Problem, residual: Array, joint: int) -> Account | None:
        """Beside a curve over the joint's velocity and the free inertial numbers; None with too few rows.

        Args:
            residual: of the joint's torque, shape (R,).
        """
        rows = np.flatnonzero(problem.sliding[:, joint] > 0)
        if rows.size < FEWEST_ROWS or not np.any(residual[rows]):
            return None
        velocity = problem.velocity[rows, joint]
        lines = np.column_stack([np.sign(velocity), velocity])
        known = np.hstack([bins(velocity), lines, problem.nuisance[rows, joint]])
        return cls(problem, joint, rows, residual[rows], known)

    @property
    def position(self) -> Array:
        """Of the joint, shape (K,)."""
        return self.problem.position[self.rows, self.joint]

    @property
    def velocity(self) -> Array:
        """Of the joint, shape (K,)."""
        return self.problem.velocity[self.rows, self.joint]

    @property
    def direction(self) -> Array:
        """1 where the joint moves forward, -1 where backward, shape (K,)."""
        return np.sign(self.velocity)

    @cached_property
    def half(self) -> NDArray[np.int_]:
        """Half to which a row's block belongs, shape (K,)."""
        return self.problem.blocks[self.rows] % 2

    def foretold(self, columns: Array) -> Array:
        """Each half of the residual by what the other makes of `columns` and the known ones, shape (K,).

        Args:
            columns: shape (K, k), or (2, K, k) where those for the halves differ.
        """
        foretold = np.zeros(self.residual.size)
        for half, own_columns in enumerate(np.broadcast_to(columns, (2, *columns.shape[-2:]))):
            every = np.hstack([self.known, own_columns])
            own = self.half == half
            foretold[own] = every[own] @ solved(every[~own], self.residual[~own])
        return foretold

    def span(self, rows: NDArray[np.bool_]) -> Array:
        """Orthonormal columns that span the known ones in some of the rows, shape (L, k)."""
        own = self.known[rows]
        scale = np.linalg.norm(own, axis=0)
        left, size, _ = np.linalg.svd(own[:, scale > 0] / scale[scale > 0], full_matrices=False)
        return np.asarray(left[:, size > SINGULAR * size.max(initial=0.0)])

    def share(self, columns: Array) -> Share:
        """What `columns`, as in `foretold`, explain beyond the known ones."""
        left = self._left(self.foretold(columns))
        return Share(self.before - float(left.sum()) / self._energy, left)

    def is_worth_telling(self, gain: float) -> bool:
        """Whether a part of the energy is large beside what the known columns leave."""
        return gain > LEAST_FURTHER and gain > LEAST_OF_REST * self.before

    def is_clear(self, share: Share) -> bool:
        """Whether it is a part worth telling, by more than chance."""
        if not self.is_worth_telling(share.share):
            return False
        return all(paired_block_p_value(left, share.left) < CHANCE for left in self._without)

    def beside(self, columns: Array) -> Account:
        """The same account with more columns known."""
        return Account(self.problem, self.joint, self.rows, self.residual, np.hstack([self.known, columns]))

    @cached_property
    def _energy(self) -> float:
        return float(self.residual @ self.residual)

    @cached_property
    def _without(self) -> tuple[Array, Array]:
        """What is left in each block by the known columns, and without these, which may foretell worse."""
        rows = self.residual.size
        return self._left(self.foretold(np.zeros((rows, 0)))), self._left(np.zeros(rows))

    @cached_property
    def before(self) -> float:
        """Part of the energy that is left without further columns."""
        return min(float(left.sum()) for left in self._without) / self._energy

    def _left(self, foretold: Array) -> Array:
        squares = (self.residual - foretold) ** 2
        return np.asarray(np.bincount(self.problem.blocks[self.rows], squares), dtype=float)


def more(share: Share, rival: Share, *, part: float = 0.0) -> bool:
    """Whether `share` explains more than `rival`, by more than chance and by this part of itself."""
    if share.share * (1.0 - part) <= rival.share:
        return False
    return paired_block_p_value(rival.left, share.left) < CHANCE


def bins(values: Array) -> Array:
    """A column of ones and zeros for each of the bins, which hold equally many of `values`, (K, bins)."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))
    number = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, max(edges.size - 2, 0))
    return np.asarray(number[:, None] == np.arange(max(edges.size - 1, 1)), dtype=float)


def solved(columns: Array, target: Array) -> Array:
    """Least squares with a slight ridge; columns without any entry get nothing."""
    scale = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(scale > 0, scale, 1.0)
    gram = scaled.T @ scaled + RIDGE * np.eye(scale.size)
    return np.asarray(np.linalg.solve(gram, scaled.T @ target) / np.where(scale > 0, scale, 1.0))
