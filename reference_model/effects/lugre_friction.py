"""LuGre friction: bristles that bend before they slide."""

from __future__ import annotations

import math
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
from reference_model.effects.stribeck_friction import stribeck_level, stribeck_velocities

__all__ = ["LuGreFriction"]

#: Keeps the state's rate finite when both friction torques are at zero [N m or N].
SMALLEST_LEVEL = 1e-9
#: Starting values: bristle deflection at break-away as a share of the travel (published: 1e-5 to 1e-3 rad).
BREAKAWAY_SHARES = (1e-4, 1e-3, 1e-2, 1e-1)
#: Starting value of the bristles' time constant, in sample times: faster ones do not show.
DAMPING_SAMPLES = 2.0


class LuGreFriction(JointEffect):
    """zd = qd - s0 |qd| z / g(qd), T = -(s0 z + s1(qd) zd), with the state z in rad or m.

    The damping is s1(v) = s1 / (1 + s1 |v| / (4 g(v))). With a constant s1 the law can give out energy when
    s1 |v| > 4 g(v); this form stays below that limit at every speed, tends to the constant
    near rest, and needs no parameter more. With the bristle energy s0 z^2 / 2 as storage the dissipated
    power is s1 v^2 - (s1/g) |v| v w + (|v|/g) w^2, w = s0 z: a form that is never negative below the limit.
    """

    id = "lugre_friction"
    title = "LuGre friction"
    place = "joint"
    parameters = (
        Parameter(
            "coulomb_torque", "N m", "sliding friction torque at high speed", 0.0, 1e5, 5.0, absent=0.0
        ),
        Parameter("static_torque", "N m", "sliding friction torque near rest", 0.0, 1e5, 7.0, absent=0.0),
        Parameter(
            "stribeck_velocity",
            "rad/s",
            "speed at which the excess over Coulomb friction has fallen to 1/e",
            1e-5,
            10.0,
            0.02,
        ),
        Parameter("bristle_stiffness", "N m/rad", "stiffness before sliding", 1.0, 1e9, 1e4),
        Parameter("bristle_damping", "N m s/rad", "damping before sliding", 0.0, 1e6, 10.0),
    )
    equation = (
        "zd = qd - bristle_stiffness * |qd| * z / g, "
        "g = coulomb_torque + (static_torque - coulomb_torque) * exp(-(qd/stribeck_velocity)^2), "
        "T = -(bristle_stiffness * z + s1 * zd), s1 = bristle_damping / (1 + bristle_damping * |qd| / (4 g))"
    )
    source = (
        "Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40 (1995) 419-425; "
        "passivity: Barahanov and Ortega, IEEE TAC 45 (2000) 830-832"
    )
    signature = (
        "after a reversal the torque builds up over a small travel instead of jumping; below break-away the "
        "joint acts as a spring with a hysteresis loop"
    )
    confused_with = (
        "stribeck_friction",
        "coulomb_friction",
        "joint_elasticity",
        "gear_hysteresis",
        "backlash",
    )
    experiment = (
        "slow reversals of falling amplitude: the loop's area falls faster than its width, "
        "while backlash keeps its width"
    )
    family = "dry_friction"
    rung = 3
    essential = ("bristle_stiffness",)
    is_friction_law = True
    states = 1
    needs = ("velocity",)

    def _level(self, s: JointSignals, p: Values) -> ca.SX:
        return stribeck_level(s.velocity, p) + SMALLEST_LEVEL

    def implausible(self, values: Mapping[str, float]) -> str:
        if values["static_torque"] < values["coulomb_torque"]:
            return "it would need a static friction below the kinetic one"
        return ""

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        damping = p["bristle_damping"]
        damping = damping / (1 + damping * ca.fabs(s.velocity) / (4 * self._level(s, p)))
        return -(p["bristle_stiffness"] * z + damping * self.state_rate(s, p, z))

    def state_rate(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return s.velocity - p["bristle_stiffness"] * ca.fabs(s.velocity) * z / self._level(s, p)

    def initial_state(self, s: JointSignals, p: Values) -> ca.SX:
        """The sliding state when the first sample moves, unbent bristles when it rests."""
        return self._level(s, p) / p["bristle_stiffness"] * smooth_sign(s.velocity, s.transition)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """Of velocity, stiffness and damping; the two torques start where the simpler law left them."""
        level = math.sqrt(max(extent.residual * extent.torque, 1e-12))
        velocities = stribeck_velocities(extent, self.parameter("stribeck_velocity"))
        stiffness, damping = self.parameter("bristle_stiffness"), self.parameter("bristle_damping")
        travel = max(extent.position[1] - extent.position[0], extent.slow * extent.sample_time, 1e-9)
        found: list[dict[str, float]] = []
        for share in BREAKAWAY_SHARES:
            s0 = min(max(level / (share * travel), stiffness.lower), stiffness.upper)
            s1 = min(s0 * DAMPING_SAMPLES * extent.sample_time, damping.upper)
            for velocity in (velocities[0], math.sqrt(velocities[0] * velocities[-1])):
                found.append({"stribeck_velocity": velocity, "bristle_stiffness": s0, "bristle_damping": s1})
        return tuple(found)
