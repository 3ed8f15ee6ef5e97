"""Reaction wheels: angular momentum on board the base that the description lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import Extent, Parameter, Values
from reference_model.effects.body_force import BodySignals, ForceEffect
from robot_model import Robot

__all__ = ["ReactionWheel"]

AXES = ("x", "y", "z")


def _per_axis(name: str, unit: str, meaning: str, bound: float, typical: float) -> tuple[Parameter, ...]:
    return tuple(
        Parameter(
            f"{name}_{axis}",
            unit,
            f"{meaning} {axis}",
            -bound,
            bound,
            typical,
            absent=0.0,
            linear=True,
            default=0.0,
        )
        for axis in AXES
    )


class ReactionWheel(ForceEffect):
    """Three wheels that spin about the base's axes, with momentum h, motor torque and drag.

    h is each rotor's total momentum about its own axis, so that it changes only by motor torque and drag, and
    the described base excludes the rotors' inertia about these axes. A wheel whose mass centre is off its
    axis shakes the base at its speed h/rotor_inertia.
    """

    id = "reaction_wheel"
    title = "Reaction wheels"
    place = "base"
    parameters = (
        *_per_axis("momentum", "N m s", "momentum at time 0 of the wheel about the base's", 1e4, 1.0),
        *_per_axis("torque", "N m", "motor torque on the wheel about the base's", 1e3, 0.01),
        Parameter(
            "drag",
            "1/s",
            "decay rate of an unpowered wheel's speed",
            0.0,
            10.0,
            1e-3,
            absent=0.0,
            default=0.0,
        ),
        Parameter(
            "imbalance",
            "kg m",
            "mass of each rotor times its centre's distance from the axis",
            0.0,
            1.0,
            1e-6,
            absent=0.0,
            estimated=False,
            default=0.0,
        ),
        Parameter(
            "rotor_inertia",
            "kg m^2",
            "of each rotor about its axis, from which its speed follows",
            1e-6,
            1e3,
            0.01,
            estimated=False,
            default=0.01,
        ),
    )
    equation = (
        "hd = torque - drag h; moment on the base = -omega x h - hd; "
        "force across axis i = imbalance Omega_i^2 (cos phi_i, sin phi_i), "
        "phid_i = Omega_i = h_i/rotor_inertia"
    )
    source = "Hughes, Spacecraft Attitude Dynamics (1986), sec. 3.4 and 6.1 (gyrostats)"
    signature = (
        "whenever the arm turns the base, it also turns about an axis perpendicular to its rate, with no "
        "torque at a joint; lines at the wheels' speeds in the base's accelerations"
    )
    confused_with = ("inertia", "base_motion", "external_torque", "slosh")
    experiment = (
        "turn the base about three axes one by one: the extra rate is perpendicular to the turn and to the "
        "wheel's axis; change the wheel speed"
    )
    needs = ("angular_velocity",)
    states = 6
    along_base = True

    def limits(self, robot: Robot, at: str) -> Mapping[str, tuple[float, float]]:
        """Drag of the wheels is hardly observable at joints."""
        return {"drag": (0.0, 0.0)}

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        return ({"drag": self.parameter("drag").typical},)

    def acts(self, p: Mapping[str, float]) -> bool:
        return any(p[f"{what}_{axis}"] for what in ("momentum", "torque") for axis in AXES)

    def wrench(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        momentum, phase = z[:3], z[3:]
        moment = -ca.cross(s.velocity[3:], momentum) - self._momentum_rate(p, momentum)
        return ca.vertcat(self._shaking(p, momentum, phase), moment)

    def state_rate(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        return ca.vertcat(self._momentum_rate(p, z[:3]), z[:3] / p["rotor_inertia"])

    def initial_state(self, p: Mapping[str, float]) -> tuple[float, ...]:
        return (*(p[f"momentum_{axis}"] for axis in AXES), 0.0, 0.0, 0.0)

    def spin(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        return z[:3]

    def _momentum_rate(self, p: Values, momentum: ca.SX) -> ca.SX:
        return ca.vertcat(*(p[f"torque_{axis}"] for axis in AXES)) - p["drag"] * momentum

    def _shaking(self, p: Values, momentum: ca.SX, phase: ca.SX) -> ca.SX:
        """Imbalance force of wheel i along the next two axes."""
        force = ca.SX(3, 1)
        for i in range(3):
            size = p["imbalance"] * (momentum[i] / p["rotor_inertia"]) ** 2
            force[(i + 1) % 3] += size * ca.cos(phase[i])
            force[(i + 2) % 3] += size * ca.sin(phase[i])
        return force
