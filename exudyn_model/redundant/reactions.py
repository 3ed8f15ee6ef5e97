"""Bearing loads from Exudyn's constraint forces.

With constraints g(q) = 0 and M qdd + g_q^T lambda = f, a multiplier acts on the outer part of its constraint
with -lambda. A joint's equations are those of Exudyn's `ObjectJointGeneric`, in this order: three
translations, global where all three are locked and along the outer joint axes otherwise; then products of
axes a0 . b1 that vanish, whose moment on the inner body is b1 x a0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.bearing import Load
from exudyn_model.bodies.rotation import cross
from exudyn_model.redundant.bodies.handles import Handle

__all__ = ["bearing_load", "constraint_wrench"]

Array = NDArray[np.float64]

#: Axes (of the outer, of the inner joint frame) that are kept perpendicular, by multiplier from the fourth.
PRODUCTS = {
    "revolute": ((2, 0), (2, 1)),
    "prismatic": ((2, 1), (2, 0), (0, 1)),
    "fixed": ((2, 1), (2, 0), (0, 1)),
    "spherical": (),
}


def constraint_wrench(
    kind: str, multipliers: Sequence[float] | Array, outer: Handle, inner: Handle
) -> tuple[Array, Array]:
    """Force on the inner body and moment about its attachment point, inertial axes [N, N m]."""
    force = -np.asarray(multipliers[:3], dtype=float)
    if kind == "prismatic":
        force = outer.joint @ force
    moment = np.zeros(3)
    for multiplier, (a, b) in zip(multipliers[3:], PRODUCTS[kind]):
        moment -= multiplier * cross(inner.joint[:, b], outer.joint[:, a])
    return force, moment


def bearing_load(kind: str, multipliers: Sequence[float] | Array, outer: Handle, inner: Handle) -> Load:
    """The load of a revolute or prismatic joint."""
    force, moment = constraint_wrench(kind, multipliers, outer, inner)
    return Load.of(kind, force, moment, outer.joint[:, 2])
