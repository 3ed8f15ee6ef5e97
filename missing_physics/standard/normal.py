"""Normal equations of groups of rows, joint by joint.

A joint's torque depends on the bodies that it carries and on its rotor and friction: often few of all
parameters, such as those of one leg of four. So each joint has normal equations in its own parameters only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import NDArray

__all__ = ["Normal", "Places", "acting", "total_of"]

Array = NDArray[np.float64]
Places = NDArray[np.int_]


@dataclass(frozen=True)
class Normal:
    """Normal equations of one group of rows.

    Attributes:
        active: indices of the parameters on which each joint's torque depends, shape (u,) each.
        gram: products of their columns with each other at each joint, shape (u, u) each.
        right: products of their columns with the torque, shape (u,) each.
        square: sum of squares of the torque at each joint, shape (n,).
        count: rows that are compared at each joint, shape (n,).
        size: number of all parameters.
    """

    active: tuple[Places, ...]
    gram: tuple[Array, ...]
    right: tuple[Array, ...]
    square: Array
    count: Array
    size: int

    @classmethod
    def of(
        cls, active: Sequence[Places], columns: Sequence[Array], torque: Array, count: Array, size: int
    ) -> Normal:
        """Normal equations of some rows.

        Args:
            active: see above.
            columns: of these parameters at each joint, zero where nothing is compared, shape (K, u) each.
            torque: zero where nothing is compared, shape (K, n).
            count, size: see above.
        """
        gram = tuple(own.T @ own for own in columns)
        right = tuple(own.T @ torque[:, k] for k, own in enumerate(columns))
        return cls(tuple(active), gram, right, np.sum(torque**2, axis=0), count, size)

    def __add__(self, other: Normal) -> Normal:
        """Normal equations of both groups of rows, which have the same parameters at every joint."""
        gram = tuple(map(add, self.gram, other.gram))
        right = tuple(map(add, self.right, other.right))
        return Normal(
            self.active, gram, right, self.square + other.square, self.count + other.count, self.size
        )

    def energy(self, x: Array) -> Array:
        """Squared residual of each joint, shape (n,)."""
        parts = zip(self.square, self.active, self.gram, self.right)
        found = [square - 2.0 * (r @ x[own]) + x[own] @ g @ x[own] for square, own, g, r in parts]
        return np.maximum(found, 0.0)

    def weighted(self, weight: Array) -> tuple[Array, Array]:
        """Weighted sums over the joints of gram and right, shapes (X, X) and (X,).

        Args:
            weight: of each joint, shape (n,).
        """
        gram, right = np.zeros((self.size, self.size)), np.zeros(self.size)
        for w, own, g, r in zip(weight, self.active, self.gram, self.right):
            gram[own[:, None], own] += w * g
            right[own] += w * r
        return gram, right


def total_of(groups: Sequence[Normal]) -> Normal:
    """Normal equations of all groups, at least one."""
    return reduce(add, groups)


def acting(designs: Sequence[Array]) -> tuple[Places, ...]:
    """Indices of the parameters on which each joint's torque depends in any recording, see `Normal.active`.

    Args:
        designs: derivatives of the torques by the parameters, shape (K, n, X) each.
    """
    nonzero = np.any([design.any(axis=0) for design in designs], axis=0)
    return tuple(map(np.flatnonzero, nonzero))
