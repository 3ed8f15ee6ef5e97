"""Bearing loads from the forces with which Exudyn keeps its constraints.

With constraints g(q) = 0 and M qdd + g_q^T lambda = f, a multiplier acts on the outer part of its constraint
with -lambda. A joint's equations are those of Exudyn's `ObjectJointGeneric`, in this order: three
translations, global where all three are locked and along the outer joint axes otherwise; then products of
axes a0 . b1 that vanish, whose moment on the inner body is b1 x a0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from exudyn_model.redundant.handles import Handle
from exudyn_model.rotation import cross
from robot_model import Bearing

__all__ = ["Load", "bearing_load", "constraint_wrench"]

Array = NDArray[np.float64]

#: Axes (of the outer, of the inner joint frame) that are kept perpendicular, by multiplier from the fourth.
PRODUCTS = {
    "revolute": ((2, 0), (2, 1)),
    "prismatic": ((2, 1), (2, 0), (0, 1)),
    "fixed": ((2, 1), (2, 0), (0, 1)),
    "spherical": (),
}


@dataclass(frozen=True)
class Load:
    """What a joint's bearing carries.

    Attributes:
        radial: force across the axis, inertial axes [N], shape (3,).
        axial: force along it [N], signed.
        bending: moment about the joint's centre, inertial axes [N m], shape (3,); across the axis of a
            revolute joint, the whole of a prismatic one's.
        axis: unit vector, inertial axes, shape (3,).
    """

    radial: Array
    axial: float
    bending: Array
    axis: Array

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


def constraint_wrench(
    kind: str, multipliers: Sequence[float] | Array, outer: Handle, inner: Handle
) -> tuple[Array, Array]:
    """Force on the inner body and moment about the point that it holds, inertial axes [N, N m]."""
    force = -np.asarray(multipliers[:3], dtype=float)
    if kind == "prismatic":
        force = outer.joint @ force
    moment = np.zeros(3)
    for multiplier, (a, b) in zip(multipliers[3:], PRODUCTS[kind]):
        moment -= multiplier * cross(inner.joint[:, b], outer.joint[:, a])
    return force, moment


def bearing_load(kind: str, multipliers: Sequence[float] | Array, outer: Handle, inner: Handle) -> Load:
    """The load of a revolute or prismatic joint.

    The guide of a prismatic joint carries no force along its axis, the drive does, but the whole moment.
    """
    force, moment = constraint_wrench(kind, multipliers, outer, inner)
    axis = outer.joint[:, 2]
    along = float(force @ axis)
    if kind == "prismatic":
        return Load(force - along * axis, 0.0, moment, axis)
    return Load(force - along * axis, along, moment - (moment @ axis) * axis, axis)
