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
)

__all__ = [
    "LEVEL_SHARES",
    "StribeckFriction",
    "rest_below_sliding",
    "static_is_too_large",
    "stribeck_level",
    "stribeck_velocities",
]

#: Starting Stribeck velocities, as multiples of the slow speed of a motion.
SLOW_MULTIPLES = (0.2, 0.6, 2.0)
#: And as fractions of its highest speed: published fits reach a third of the rated speed.
FAST_SHARES = (0.1, 0.3)
#: Largest ratio of friction at rest to that at high speed: boundary friction of about 0.15 falls to some
#: hundredths under full lubrication.
LARGEST_RATIO = 10.0

#: Dependence of the level on the bearing load W and on the torque; absent unless a robot file gives it.
LEVEL_SHARES = (
    Parameter(
        "load_coefficient",
        "-",
        "fraction of the bearing load that adds to the level at high speed",
        0.0,
        10.0,
        0.1,
        absent=0.0,
        estimated=False,
        default=0.0,
    ),
    Parameter(
        "load_static_coefficient",
        "-",
        "fraction of the bearing load that adds to the level near rest; load_coefficient if that is larger",
        0.0,
        10.0,
        0.15,
        absent=0.0,
        estimated=False,
        default=0.0,
    ),
    Parameter(
        "gear_share",
        "-",
        "fraction of the actuator's torque that adds to the level at any speed",
        0.0,
        1.0,
        0.05,
        absent=0.0,
        estimated=False,
        default=0.0,
    ),
)


def stribeck_level(s: JointSignals, p: Values, load: ca.SX) -> ca.SX:
    """g = kinetic + (static - kinetic) exp(-(v/vs)^2) [N m or N].

    kinetic = Tc + mu_d W + share |u|, static = Ts + mu_s W + share |u|, W the `load` moment and u the
    actuator torque. A preload of the bearing is a constant part: Tc = mu_d W_pre, Ts = mu_s W_pre. At a
    temperature other than the joint's reference, each has its own factor.
    """
    fall = ca.exp(-((s.velocity / p["stribeck_velocity"]) ** 2))
    kinetic = p["coulomb_torque"] + p["load_coefficient"] * load + p["gear_share"] * ca.fabs(s.torque)
    excess = ca.fmax(p["load_static_coefficient"] - p["load_coefficient"], 0)
    above = p["static_torque"] - p["coulomb_torque"] + excess * load
    sliding, resting = s.kinetic_factor, s.static_factor
    return sliding * kinetic + (resting * above + (resting - sliding) * kinetic) * fall


def rest_below_sliding(values: Mapping[str, float]) -> str:
    """Message if friction at rest is smaller than sliding friction; else empty.

    A load_static_coefficient of zero counts as omitted.
    """
    for rest, sliding, given in (
        ("static_torque", "coulomb_torque", True),
        ("load_static_coefficient", "load_coefficient", values["load_static_coefficient"] > 0),
    ):
        if given and values[rest] < values[sliding]:
            return (
                f"{rest} = {values[rest]:g} is below {sliding} = {values[sliding]:g}; friction at rest is at "
                "least that of sliding"
            )
    return ""


def stribeck_velocities(extent: Extent, parameter: Parameter) -> tuple[float, ...]:
    """Starting values of the Stribeck velocity, increasing, within the bounds of `parameter`."""
    found = [k * extent.slow for k in SLOW_MULTIPLES] + [k * extent.speed for k in FAST_SHARES]
    return tuple(sorted({min(max(v, parameter.lower), parameter.upper) for v in found}))


def static_is_too_large(values: Mapping[str, float]) -> str:
    """Reason why static friction is implausible given the kinetic one, as half a sentence; else empty."""
    if values["static_torque"] > LARGEST_RATIO * values["coulomb_torque"]:
        return f"its static friction would be more than {LARGEST_RATIO:g} times its kinetic friction"
    return ""


def observable_velocities(extent: Extent, parameter: Parameter) -> tuple[float, float]:
    """Bounds of the Stribeck velocity: far below its lowest start no recorded speed determines it."""
    return max(0.5 * stribeck_velocities(extent, parameter)[0], parameter.lower), parameter.upper


class StribeckFriction(JointEffect):
    """T = -(Tc + (Ts - Tc) exp(-(qd/vs)^2)) sgn(qd), Tc and Ts optionally depending on the bearing load."""

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
        *LEVEL_SHARES,
    )
    equation = (
        "T = -(kinetic + (static - kinetic) * exp(-(qd/stribeck_velocity)^2)) * sgn(qd), "
        "kinetic = coulomb_torque + load_coefficient * W + gear_share * |torque|, "
        "static = static_torque + load_static_coefficient * W + gear_share * |torque|, "
        "W as in load_dependent_friction"
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
    ordered = (("static_torque", "coulomb_torque"),)
    is_friction_law = True
    needs = ("velocity",)

    def bounds(self, extent: Extent) -> Mapping[str, tuple[float, float]]:
        return {"stribeck_velocity": observable_velocities(extent, self.parameter("stribeck_velocity"))}

    def implausible(self, values: Mapping[str, float]) -> str:
        if values["static_torque"] <= values["coulomb_torque"]:
            return "it would need a static friction below the kinetic one"
        return static_is_too_large(values)

    def contradiction(self, values: Mapping[str, float]) -> str:
        return rest_below_sliding(values)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return -stribeck_level(s, p, s.load_moment) * s.sign

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        velocities = stribeck_velocities(extent, self.parameter("stribeck_velocity"))
        return tuple({"stribeck_velocity": velocity} for velocity in velocities)
