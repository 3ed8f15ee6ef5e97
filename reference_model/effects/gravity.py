"""Gravity: the field differs from the description, or the base is not level."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import casadi as ca

from reference_model.effects.base import BodyEffect, BodyTerms, Parameter, Values

__all__ = ["TILT", "Gravity"]

#: Usual error of gravity on the ground, as a part of its size: two degrees of tilt. Floors under automation
#: equipment are level to half a degree (common limit of foundations); the rest is engineering judgement. A
#: robot may be mounted at any angle, but gravity's size is known to 0.3 % anywhere (WGS 84: 9.780 to
#: 9.832 m/s^2).
TILT = 0.035


class Gravity(BodyEffect):
    """An addition to the gravity vector: a tilted base, imperfect off-loading, or missing gravity."""

    id = "gravity"
    title = "Wrong or forgotten gravity"
    place = "base"
    parameters = tuple(
        # The bound allows all of Earth's gravity to be missing or to have the wrong sign.
        Parameter(
            axis,
            "m/s^2",
            f"addition to gravity along {axis} of the inertial frame",
            -20.0,
            20.0,
            1.0,
            absent=0.0,
            linear=True,
            default=0.0,
        )
        for axis in ("x", "y", "z")
    )
    #: A usual error on the ground is two standard deviations, of 9.80665 m/s^2.
    priors: ClassVar[Mapping[str, tuple[float, float]]] = dict.fromkeys("xyz", (0.0, 0.5 * TILT * 9.80665))
    equation = "adds (x, y, z) to the gravity vector"
    source = (
        "Siciliano, Sciavicco, Villani and Oriolo, Robotics: Modelling, Planning and Control (2009), ch. 7 "
        "(gravity in the equations of motion); a table tilted by 1e-4 rad leaves 1e-3 m/s^2 of Earth's"
    )
    signature = "residuals that follow the absolute pose, also at rest, whatever the direction of motion"
    confused_with = ("cable_spring", "torque_offset", "asymmetric_friction", "payload", "inertia")
    experiment = "hold poses all around, then turn or tilt the whole robot: gravity turns with it"
    needs = ("torque", "position")

    def terms(self, p: Values) -> BodyTerms:
        return BodyTerms(gravity=ca.SX(ca.vertcat(p["x"], p["y"], p["z"])))
