"""Mass properties of rigid bodies: moved, added, and corrected where they are impossible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_model.formats.parts.poses import Pose

__all__ = ["Mass", "nearest_realisable"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mass:
    """Mass properties of a rigid body in some frame.

    Attributes:
        mass: [kg].
        centre: centre of mass in the frame [m], shape (3,).
        inertia: about the centre of mass in the frame's axes [kg m^2], shape (3, 3).
    """

    mass: float
    centre: Array
    inertia: Array

    @property
    def is_nothing(self) -> bool:
        """Neither mass nor moments of inertia."""
        return self.mass == 0 and not self.inertia.any()

    def seen_from(self, pose: Pose) -> Mass:
        """The same body in the frame in which its own frame has `pose`."""
        turned = pose.rotation @ self.inertia @ pose.rotation.T
        return Mass(self.mass, pose.place + pose.rotation @ self.centre, (turned + turned.T) / 2)

    def __add__(self, other: Mass) -> Mass:
        """Both bodies rigidly joined, in their common frame (Huygens and Steiner)."""
        if other.is_nothing or self.is_nothing:
            return self if other.is_nothing else other
        whole = self.mass + other.mass
        centre = (self.mass * self.centre + other.mass * other.centre) / whole if whole else self.centre
        inertia = self.inertia + other.inertia
        for part in (self, other):
            arm = part.centre - centre
            inertia = inertia + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return Mass(whole, centre, inertia)


def nearest_realisable(inertia: Array) -> Array:
    """The moments of inertia nearest to `inertia` that a body can have [kg m^2], shape (3, 3).

    A body's second moments P = tr(I)/2 1 - I are an integral of x x^T over its mass, and so are not
    negative in any direction; conversely every such P is that of some body. Negative principal values of P
    are set to zero, which is the nearest such matrix by the Frobenius norm (Higham 1988).
    """
    second = np.trace(inertia) / 2 * np.eye(3) - inertia
    values, axes = np.linalg.eigh(second)
    second = axes @ np.diag(np.clip(values, 0.0, None)) @ axes.T
    return np.trace(second) * np.eye(3) - second
