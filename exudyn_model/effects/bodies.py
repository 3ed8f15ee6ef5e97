"""Changes of a link's mass properties and of gravity, in the link's own frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from exudyn_model.mechanism import Mass
from exudyn_model.rotation import skew

__all__ = ["BodyChange", "Gravity", "Inertia", "Payload"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BodyChange:
    """Base of the changes; parameters are the fields of the concrete class, in SI units."""

    def mass(self) -> Mass:
        """What is added to the link."""
        return Mass()

    def gravity(self) -> Array:
        """What is added to the gravity vector, inertial frame [m/s^2], shape (3,)."""
        return np.zeros(3)


@dataclass(frozen=True)
class Payload(BodyChange):
    """A point mass fixed to the link."""

    added_mass: float
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def mass(self) -> Mass:
        at = np.array([self.x, self.y, self.z])
        return Mass(self.added_mass, self.added_mass * at, -self.added_mass * skew(at) @ skew(at))


@dataclass(frozen=True)
class Inertia(BodyChange):
    """Errors of the link's moments of inertia, about axes through its frame's origin."""

    xx: float = 0.0
    yy: float = 0.0
    zz: float = 0.0

    def mass(self) -> Mass:
        return Mass(inertia=np.diag([self.xx, self.yy, self.zz]))


@dataclass(frozen=True)
class Gravity(BodyChange):
    """An error of the gravity vector, inertial frame."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def gravity(self) -> Array:
        return np.array([self.x, self.y, self.z])
