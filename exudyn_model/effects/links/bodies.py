"""Changes of a link's mass properties and of gravity, in the link's own frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.mechanism import Mass, PointMass
from exudyn_model.bodies.rotation import skew

__all__ = ["BodyChange", "Gravity", "Inertia", "Payload"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BodyChange:
    """Base of the changes; parameters are the fields of the concrete class, in SI units."""

    def added(self) -> Mass:
        """Mass properties added to the link."""
        return Mass()

    def added_gravity(self) -> Array:
        """Addition to the gravity vector, inertial frame [m/s^2], shape (3,)."""
        return np.zeros(3)


@dataclass(frozen=True)
class Payload(BodyChange):
    """A point mass fixed to the link at (x, y, z)."""

    mass: float
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def point(self) -> PointMass:
        """The same on a flexible link."""
        return PointMass(self.mass, np.array([self.x, self.y, self.z]))

    def added(self) -> Mass:
        at = np.array([self.x, self.y, self.z])
        return Mass(self.mass, self.mass * at, -self.mass * skew(at) @ skew(at))


@dataclass(frozen=True)
class Inertia(BodyChange):
    """Changes of mass, first moment and inertia of the link, about its frame's origin."""

    mass: float = 0.0
    first_moment_x: float = 0.0
    first_moment_y: float = 0.0
    first_moment_z: float = 0.0
    inertia_xx: float = 0.0
    inertia_yy: float = 0.0
    inertia_zz: float = 0.0
    inertia_xy: float = 0.0
    inertia_xz: float = 0.0
    inertia_yz: float = 0.0

    def added(self) -> Mass:
        moment = np.array([self.first_moment_x, self.first_moment_y, self.first_moment_z])
        rows = [
            [self.inertia_xx, self.inertia_xy, self.inertia_xz],
            [self.inertia_xy, self.inertia_yy, self.inertia_yz],
            [self.inertia_xz, self.inertia_yz, self.inertia_zz],
        ]
        return Mass(self.mass, moment, np.array(rows))


@dataclass(frozen=True)
class Gravity(BodyChange):
    """An error of the gravity vector, inertial frame."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def added_gravity(self) -> Array:
        return np.array([self.x, self.y, self.z])
