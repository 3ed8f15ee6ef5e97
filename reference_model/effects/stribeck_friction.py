"""Stribeck friction: Coulomb friction that is higher near standstill."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import (
    Extent,
    JointEffect,
    JointSignals,
    Parameter,
    Values,
    smooth_sign,
)

__all__ = ["StribeckFriction", "stribeck_level", "stribeck_velocities"]

#: Where the fall from static to Coulomb friction is looked for, as multiples of the slow speed of a motion.
SLOW_MULTIPLES = (0.2, 0.6, 2.0)
#: And as shares of its highest speed: the range of published fits reaches a third of the rated speed.
FAST_SHARES = (0.1, 0.3)


def stribeck_level(velocity: ca.SX, p: Values) -> ca.SX:
    """g(v) = Tc + (Ts - Tc) exp(-(v/vs)^2) [N m or N]; the load is taken into Tc and Ts."""
    share = ca.exp(-((velocity / p["stribeck_velocity"]) ** 2))
    return p["coulomb_torque"] + (p["static_torque"] - p["coulomb_torque"]) * share


def stribeck_velocities(extent: Extent, parameter: Parameter) -> tuple[float, ...]:
    """Starting values of the Stribeck velocity, rising, within the bounds of `parameter`."""
    found = [k * extent.slow for k in SLOW_MULTIPLES] + [k * extent.speed for k in FAST_SHARES]
    return tuple(sorted({min(max(v, parameter.lower), parameter.upper) for v in found}))


class StribeckFriction(JointEffect):
    """T = -(Tc + (Ts - Tc) exp(-(qd/vs)^2)) sgn(qd)."""

    id = "stribeck_friction"
    title = "Stribeck friction"
    place = "joint"
    parameters = (
        Parameter(
            "coulomb_torque", "N m", "friction torque at high speed", 0.0, 1e5, 5.0, absent=0.0, linear=True
        ),
        Parameter(
            "static_torque", "N m", "friction torque near rest", 0.0, 1e5, 7.0, absent=0.0, linear=True
        ),
        Parameter(
            "stribeck_velocity",
            "rad/s",
            "speed at which the excess over Coulomb friction has fallen to 1/e",
            1e-5,
            10.0,
            0.02,
        ),
    )
    equation = (
        "T = -(coulomb_torque + (static_torque - coulomb_torque) * exp(-(qd/stribeck_velocity)^2)) * sgn(qd)"
    )
    source = "Bo and Pavelescu, Wear 82 (1982) 277-289; exponent 2 as in Canudas de Wit et al. 1995"
    signature = "friction falls with speed just above standstill, which can make slow motion stick and slip"
    confused_with = ("coulomb_friction", "lugre_friction", "temperature_dependent_friction", "sensor_delay")
    experiment = (
        "constant speeds spaced logarithmically at one temperature; then change the controller's stiffness: "
        "the stick-slip changes, the friction curve does not"
    )
    family = "dry_friction"
    rung = 2
    essential = ("stribeck_velocity",)
    is_friction_law = True
    needs = ("velocity",)

    def implausible(self, values: Mapping[str, float]) -> str:
        if values["static_torque"] <= values["coulomb_torque"]:
            return "it would need a static friction below the kinetic one"
        return ""

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return -stribeck_level(s.velocity, p) * smooth_sign(s.velocity, s.transition)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        velocities = stribeck_velocities(extent, self.parameter("stribeck_velocity"))
        return tuple({"stribeck_velocity": velocity} for velocity in velocities)
