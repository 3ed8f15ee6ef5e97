"""Torque ripple: cogging, and commutation ripple proportional to the torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import casadi as ca

from reference_model.effects.base import Extent, JointEffect, JointSignals, Parameter, Values
from reference_model.effects.orders import order_parameter, order_starts

__all__ = ["TorqueRipple"]


class TorqueRipple(JointEffect):
    """T = (a + a_r u) cos(k q) + (b + b_r u) sin(k q), u the commanded torque.

    a, b are cogging, present without current; a_r, b_r are ripple proportional to the torque. All four are
    linear and distinguishable as soon as the torque varies at one phase of the cycle, for which the two
    directions of a motion with friction suffice.
    """

    id = "torque_ripple"
    title = "Torque ripple and cogging"
    place = "actuator"
    parameters = (
        Parameter("cosine", "N m", "cosine part of the cogging", -1e4, 1e4, 0.5, absent=0.0, linear=True),
        Parameter("sine", "N m", "sine part of the cogging", -1e4, 1e4, 0.5, absent=0.0, linear=True),
        Parameter(
            "cosine_per_torque",
            "-",
            "cosine part of the ripple, relative to the torque",
            -0.5,
            0.5,
            0.02,
            absent=0.0,
            linear=True,
            default=0.0,
        ),
        Parameter(
            "sine_per_torque",
            "-",
            "sine part of the ripple, relative to the torque",
            -0.5,
            0.5,
            0.02,
            absent=0.0,
            linear=True,
            default=0.0,
        ),
        order_parameter("phase of the cycle per joint position; the gear ratio means once per motor turn"),
    )
    #: Machines and drives leave 1 to 5 % of the torque (Jahns and Soong): within two standard deviations.
    priors: ClassVar[Mapping[str, tuple[float, float]]] = {
        "cosine_per_torque": (0.0, 0.025),
        "sine_per_torque": (0.0, 0.025),
    }
    equation = (
        "T = (cosine + cosine_per_torque * u) * cos(order * q) "
        "+ (sine + sine_per_torque * u) * sin(order * q), u = actuator torque"
    )
    source = "Holtz and Springob, IEEE TIE 43 (1996) 309-320; Jahns and Soong, IEEE TIE 43 (1996) 321-330"
    signature = "peaks at fixed orders of the motor angle; the sign does not change with the direction"
    confused_with = ("position_dependent_friction", "encoder_eccentricity", "gravity", "cable_spring")
    experiment = "long runs at two speeds and two loads, both ways; cogging stays with the drive switched off"
    uses_torque = True
    per_torque = ("cosine_per_torque", "sine_per_torque")
    needs = ("position", "torque")

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        phase = p["order"] * s.position
        cosine = p["cosine"] + p["cosine_per_torque"] * s.torque
        sine = p["sine"] + p["sine_per_torque"] * s.torque
        return cosine * ca.cos(phase) + sine * ca.sin(phase)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        return order_starts(extent, self.parameter("order"))
