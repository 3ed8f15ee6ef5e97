"""Payload: a point mass that the description lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import BodyEffect, BodyTerms, Extent, Parameter, Values

__all__ = ["Payload"]


class Payload(BodyEffect):
    """A point mass at a stated point r of a link: adds m, m r and m (r.r 1 - r r^T).

    On a flexible link it is fixed to the node nearest to r, and moves with it.

    Mass and position are estimated together. It is a special case of `inertia`.
    """

    id = "payload"
    title = "Unknown payload"
    place = "link"
    parameters = (
        Parameter("mass", "kg", "mass missing in the description", -1e4, 1e4, 1.0, absent=0.0, linear=True),
        *(
            Parameter(
                axis,
                "m",
                f"{axis} of the point in the link's frame",
                -50.0,
                50.0,
                1.0,
                default=0.0,
            )
            for axis in ("x", "y", "z")
        ),
    )
    equation = "adds mass m, first moment m r, inertia m (r.r 1 - r r^T), r = (x, y, z)"
    source = "Khalil and Dombre, Modeling, Identification and Control of Robots (2002), ch. 12"
    signature = "residuals that follow acceleration and gravity at all joints that carry the link"
    confused_with = ("inertia", "torque_gain", "load_dependent_friction", "gravity")
    experiment = "repeat the motion with the payload taken off, and hold poses of different gravity load"
    needs = ("torque",)
    essential = ("mass",)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """At the frame's origin; a diagnosis that knows the link starts at its tip."""
        return ({"x": 0.0, "y": 0.0, "z": 0.0},)

    def terms(self, p: Values) -> BodyTerms:
        point = ca.SX(ca.vertcat(p["x"], p["y"], p["z"]))
        mass = ca.SX(p["mass"])
        inertia = mass * (ca.dot(point, point) * ca.SX.eye(3) - point @ point.T)
        return BodyTerms(mass=mass, first_moment=mass * point, inertia=ca.densify(inertia), place=point)
