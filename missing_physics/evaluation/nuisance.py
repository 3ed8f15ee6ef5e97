"""Correlated noise of the rows of a recording: unknown friction at reversals, and vibration of links.

Near a quick reversal the direction of a joint's dry friction is not known, so its friction may be anything up
to its level c. The stretch is divided into cells of the filter's memory, and in each of them an unknown force
of standard deviation c is added to the white noise of the torque. Everything compared is whitened by the
inverse root of that covariance, as for vibration (`vibration.whitening`): what such forces resemble is
removed, and the rest, such as the course of friction over speed on either side, is compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.vibration.whitening import Vibration

__all__ = ["Nuisance"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Nuisance:
    """Correlated noise of one recording with n joints and K rows.

    Attributes:
        links: vibration of links, in rows that are whitened by `reversals`.
        reversals: friction at reversals, one channel for each joint; empty where these are not compared.
    """

    links: Vibration
    reversals: tuple[Vibration, ...] = ()

    @property
    def is_empty(self) -> bool:
        """Whether rows are not changed."""
        return not self.links.taken.size and not any(own.taken.size for own in self.reversals)

    @property
    def left(self) -> Array:
        """Fraction of the variance of white noise that `reversals` leave in each row, shape (K, n)."""
        if not self.reversals:
            return np.ones_like(self.links.root)
        return np.concatenate([own.left for own in self.reversals], axis=1)

    def removed(self, values: Array) -> Array:
        """Whitened series of all joints, (K, n, ...)."""
        return self.links.removed(self.without_reversals(values))

    def without_reversals(self, values: Array) -> Array:
        """Series of all joints whitened by `reversals`, (K, n, ...)."""
        found = values
        for k, own in enumerate(self.reversals):
            if own.taken.size and values[:, k].any():
                found = values.copy() if found is values else found
                found[:, k] = own.removed(values[:, [k]])[:, 0]
        return found

    def removed_at(self, joints: NDArray[np.int_], values: Array) -> tuple[NDArray[np.int_], Array]:
        """Whitened series of joints (K, a, ...), and the joints at which they then differ from zero."""
        if self.is_empty or not joints.size:
            return joints, values
        found = np.zeros((len(values), self.links.root.shape[1], *values.shape[2:]))
        found[:, joints] = values
        found = self.removed(found)
        return (np.arange(found.shape[1]), found) if self.links.taken.size else (joints, found[:, joints])
