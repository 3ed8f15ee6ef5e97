"""LuGre friction: bristles that deflect before they slide."""

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
)
from reference_model.effects.stribeck_friction import (
    LEVEL_SHARES,
    observable_velocities,
    rest_below_sliding,
    static_is_too_large,
    stribeck_level,
    stribeck_velocities,
)

__all__ = ["LuGreFriction"]

#: Keeps the state's rate finite when both friction torques are at zero [N m or N].
SMALLEST_LEVEL = 1e-9
#: Keeps the sliding deflection finite when there is no stiffness at all [N m/rad or N/m].
SMALLEST_STIFFNESS = 1e-9
#: Added to the bearing load, so that bristles whose level and stiffness both depend on it keep their sliding
#: deflection when it vanishes: a thousand times the floor of the level, far below any friction that matters.
SMALLEST_LOAD = 1e-6
#: Below this a diagnosis would divide by a vanishing stiffness [N m/rad or N/m].
SOFTEST = 1.0
#: Starting values: bristle deflection at break-away relative to the travel (published: 1e-5 to 1e-3 rad).
BREAKAWAY_SHARES = (1e-4, 1e-3, 1e-2, 1e-1)
#: Starting value of the bristles' time constant, in sample times: faster ones are not observable.
DAMPING_SAMPLES = 2.0


class LuGreFriction(JointEffect):
    """zd = qd - s0 |qd| z / g(qd), T = -(s0 z + s1(qd) zd), with the state z in rad or m.

    Level, stiffness and damping have a constant part and a part proportional to the bearing load W, so that
    the same equations cover the law in torques and the law in surface coordinates of Liu et al. (2015),
    T = -W (sigma0 zeta + sigma1 zetad + sigma2 R qd), zetad = R qd - sigma0 |R qd| zeta / g, R the radius of
    the bearing: zeta = R z, and load_stiffness, load_damping, load_viscosity are R sigma0, R sigma1,
    R sigma2, stribeck_velocity is v_s / R. A preload W_pre of the bearing is mu_d W_pre, mu_s W_pre,
    R sigma0 W_pre and R sigma1 W_pre in the constant parts. The sliding deflection g/s0 then does not depend
    on the load, and stays the same when the load vanishes.

    The damping is s1(v) = s1 / (1 + limit s1 |v| / (4 g(v))). With a constant s1 (limit 0, the original law)
    friction can generate energy when s1 |v| > 4 g(v); with limit 1 it stays below that bound at every speed
    and tends to the constant near rest. With the bristle energy s0 z^2 / 2 as storage the dissipated
    power is s1 v^2 - (s1/g) |v| v w + (|v|/g) w^2, w = s0 z: a form that is never negative below the bound.
    That is for constant stiffness; a load change while bristles are deflected stores or takes d(s0)/dt z^2/2,
    at most mu_s^2 W / (2 load_stiffness) in each rise and fall: micro-joules to millijoules.
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
        Parameter("bristle_stiffness", "N m/rad", "stiffness before sliding", 0.0, 1e9, 1e4),
        Parameter("bristle_damping", "N m s/rad", "damping before sliding", 0.0, 1e6, 10.0),
        *LEVEL_SHARES,
        Parameter(
            "load_stiffness",
            "1/rad",
            "stiffness before sliding per bearing load",
            0.0,
            1e9,
            400.0,
            estimated=False,
            default=0.0,
        ),
        Parameter(
            "load_damping",
            "s/rad",
            "damping before sliding per bearing load",
            0.0,
            1e6,
            4.0,
            estimated=False,
            default=0.0,
        ),
        Parameter(
            "load_viscosity",
            "s/rad",
            "viscous friction per bearing load",
            0.0,
            1e3,
            0.02,
            absent=0.0,
            estimated=False,
            default=0.0,
        ),
        Parameter(
            "damping_limit",
            "-",
            "1 keeps the damping passive at every speed, 0 leaves it constant as in the original law",
            0.0,
            1.0,
            1.0,
            estimated=False,
            default=1.0,
        ),
    )
    equation = (
        "zd = qd - s0 * |qd| * z / g, T = -(s0 * z + s1 * zd + load_viscosity * W * qd), "
        "g = kinetic + (static - kinetic) * exp(-(qd/stribeck_velocity)^2) as in stribeck_friction, "
        "s0 = bristle_stiffness + load_stiffness * W, d = bristle_damping + load_damping * W, "
        "s1 = d / (1 + damping_limit * d * |qd| / (4 g)), W as in load_dependent_friction"
    )
    source = (
        "Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40 (1995) 419-425; "
        "passivity: Barahanov and Ortega, IEEE TAC 45 (2000) 830-832; "
        "level in proportion to the load: Liu, Li, Wang, Cai, Aerospace Sci. Technol. 47 (2015) 164-176"
    )
    signature = (
        "after a reversal the torque builds up over a small travel instead of jumping; below break-away the "
        "joint behaves like a spring with a hysteresis loop"
    )
    confused_with = (
        "stribeck_friction",
        "coulomb_friction",
        "joint_elasticity",
        "gear_hysteresis",
        "backlash",
    )
    experiment = (
        "slow reversals of decreasing amplitude: the loop's area falls faster than its width, "
        "while backlash keeps its width"
    )
    family = "dry_friction"
    rung = 3
    essential = ("bristle_stiffness",)
    ordered = (("static_torque", "coulomb_torque"),)
    is_friction_law = True
    states = 1
    needs = ("velocity",)

    def _level(self, s: JointSignals, p: Values) -> ca.SX:
        return stribeck_level(s, p, _load(s)) + SMALLEST_LEVEL

    def _stiffness(self, s: JointSignals, p: Values) -> ca.SX:
        return p["bristle_stiffness"] + p["load_stiffness"] * _load(s) + SMALLEST_STIFFNESS

    def implausible(self, values: Mapping[str, float]) -> str:
        if values["static_torque"] < values["coulomb_torque"]:
            return "it would need a static friction below the kinetic one"
        return static_is_too_large(values)

    def bounds(self, extent: Extent) -> Mapping[str, tuple[float, float]]:
        return {
            "bristle_stiffness": (SOFTEST, self.parameter("bristle_stiffness").upper),
            "stribeck_velocity": observable_velocities(extent, self.parameter("stribeck_velocity")),
        }

    def contradiction(self, values: Mapping[str, float]) -> str:
        return rest_below_sliding(values)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        damping = p["bristle_damping"] + p["load_damping"] * _load(s)
        excess = p["damping_limit"] * damping * ca.fabs(s.velocity) / (4 * self._level(s, p))
        force = self._stiffness(s, p) * z + damping / (1 + excess) * self.state_rate(s, p, z)
        return -(force + p["load_viscosity"] * s.kinetic_factor * _load(s) * s.velocity)

    def state_rate(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return s.velocity - self._stiffness(s, p) * ca.fabs(s.velocity) * z / self._level(s, p)

    def build_up(self, values: Mapping[str, float]) -> float:
        """Bristle deflection at break-away, of the constant or the load-dependent part, if that is larger."""
        parts = (("static_torque", "bristle_stiffness"), ("load_static_coefficient", "load_stiffness"))
        return max(
            (values[level] / values[stiffness] for level, stiffness in parts if values[stiffness] > 0),
            default=0.0,
        )

    def initial_state(self, s: JointSignals, p: Values) -> ca.SX:
        """The sliding state if the first sample moves, undeflected bristles if it is at rest."""
        return self._level(s, p) / self._stiffness(s, p) * s.sign

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """Starts of velocity, stiffness and damping; the two torques start from the simpler law's fit."""
        level = math.sqrt(max(extent.residual * extent.torque, 1e-12))
        velocities = stribeck_velocities(extent, self.parameter("stribeck_velocity"))
        stiffness, damping = self.parameter("bristle_stiffness"), self.parameter("bristle_damping")
        travel = max(extent.position[1] - extent.position[0], extent.slow * extent.sample_time, 1e-9)
        found: list[dict[str, float]] = []
        for share in BREAKAWAY_SHARES:
            s0 = min(max(level / (share * travel), SOFTEST), stiffness.upper)
            s1 = min(s0 * DAMPING_SAMPLES * extent.sample_time, damping.upper)
            for velocity in (velocities[0], math.sqrt(velocities[0] * velocities[-1])):
                found.append({"stribeck_velocity": velocity, "bristle_stiffness": s0, "bristle_damping": s1})
        return tuple(found)


def _load(s: JointSignals) -> ca.SX:
    return s.load_moment + SMALLEST_LOAD
