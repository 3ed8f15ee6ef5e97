"""Position-dependent friction: changes with the angle of joint or motor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import (
    Extent,
    JointEffect,
    JointSignals,
    Parameter,
    Values,
)
from reference_model.effects.orders import order_parameter, order_starts

__all__ = ["PositionDependentFriction"]


class PositionDependentFriction(JointEffect):
    """T = -(a cos(k q) + b sin(k q)) sgn(qd), the varying part of a friction law."""

    id = "position_dependent_friction"
    title = "Position-dependent friction"
    place = "joint"
    parameters = (
        Parameter("cosine", "N m", "amplitude of the cosine part", -1e5, 1e5, 1.0, absent=0.0, linear=True),
        Parameter("sine", "N m", "amplitude of the sine part", -1e5, 1e5, 1.0, absent=0.0, linear=True),
        order_parameter("phase of the cycle per joint position; the gear ratio means once per motor turn"),
    )
    equation = "T = -(cosine * cos(order * q) + sine * sin(order * q)) * sgn(qd)"
    source = (
        "Armstrong, Control of Machines with Friction (1991); Tuttle and Seering, IEEE T-RA 12 (1996) 368-374"
    )
    signature = "peaks at fixed orders of the angle at any speed; the sign changes with the direction"
    confused_with = ("torque_ripple", "encoder_eccentricity", "gravity", "load_dependent_friction")
    experiment = "long runs at one speed both ways: odd in direction is friction, even is cogging"
    builds_on = ("coulomb_friction", "stribeck_friction", "lugre_friction")
    is_friction_law = True
    needs = ("position", "velocity")

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        phase = p["order"] * s.position
        level = p["cosine"] * ca.cos(phase) + p["sine"] * ca.sin(phase)
        return -level * s.kinetic_factor * s.sign

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        return order_starts(extent, self.parameter("order"))
