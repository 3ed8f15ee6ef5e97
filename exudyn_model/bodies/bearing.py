"""The load of a joint's bearing, and the friction moment that depends on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.rotation import cross
from robot_model import Bearing

__all__ = ["Load"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Load:
    """The load of a joint's bearing; all vectors in the same, arbitrary axes.

    Attributes:
        radial: force across the axis, [N], shape (3,).
        axial: force along it [N], signed.
        bending: moment about the joint's centre [N m], shape (3,); perpendicular to the axis of a revolute
            joint, the entire moment of a prismatic one.
        axis: unit vector, shape (3,).
    """

    radial: Array
    axial: float
    bending: Array
    axis: Array

    @classmethod
    def of(cls, kind: str, force: Array, moment: Array, axis: Array) -> Load:
        """From the force on the outboard body and the moment about the joint's centre [N, N m].

        The guide of a prismatic joint carries no force along its axis (the drive does) but the entire moment.
        """
        along = float(force @ axis)
        if kind == "prismatic":
            return cls(force - along * axis, 0.0, moment, axis)
        return cls(force - along * axis, along, moment - (moment @ axis) * axis, axis)

    @property
    def sizes(self) -> tuple[float, float, float]:
        """Radial force, axial force [N] and bending moment [N m]."""
        return float(np.linalg.norm(self.radial)), abs(self.axial), float(np.linalg.norm(self.bending))

    def friction_moment(self, bearing: Bearing) -> float:
        """W [N m]: one friction coefficient makes it a torque.

        ``W = R_n F_a + R_p F_r + (R_p / R_b) N_b``, or with two bearings at a distance b
        ``R_1,2 = F_r / 2 +- H x N_b / b`` as vectors and ``W = R_n F_a + R_p (|R_1| + |R_2|)``, besides
        which a guide carries the moment about its axis over R_b.
        """
        radial, axial, bending = self.sizes
        along = bearing.axial_arm * axial
        if bearing.span is None:
            return along + bearing.radial_arm * (radial + bending / bearing.bending_arm)
        pair = cross(self.axis, self.bending) / bearing.span
        shares = np.linalg.norm(0.5 * self.radial + pair) + np.linalg.norm(0.5 * self.radial - pair)
        twist = abs(float(self.axis @ self.bending)) / bearing.bending_arm
        return float(along + bearing.radial_arm * (shares + twist))
