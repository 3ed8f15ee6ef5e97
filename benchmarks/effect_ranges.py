"""Sizes of the effects that the challenge does not hide: gears with two encoders, links, base, surroundings.

Relative to the robot and its motion, like `missing_physics.challenge.ranges`; credible sizes are those that
the catalogue's pages name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, tanh
from types import MappingProxyType

import numpy as np

from exudyn_model import ArmInstant, ExtraForce
from exudyn_model.motion import motions
from missing_physics.challenge.ranges import Draw, Scale, bounded
from missing_physics.challenge.robots import friction_at
from robot_model import EffectUse, Recording, Robot, Sensor

__all__ = ["GEARS", "OTHERS", "Warming", "warm_up"]

Values = Mapping[str, float]
Scales = Mapping[str, Scale]

#: Temperature at which friction laws hold as given [K].
ROOM = 293.15
#: Speed over which Coulomb friction passes through zero [rad/s or m/s].
TRANSITION = 1e-4
#: A wall is met over so much of the way of the point that meets it [m].
DEPTHS = (0.004, 0.02)
#: Looks at the reference motion for where that point goes.
LOOKS = 600


@dataclass(frozen=True)
class Warming:
    """The way of joint1's temperature, the same in both recordings but for its start.

    Attributes:
        rate: relative fall of friction per kelvin [1/K].
        start, rise: temperature at time zero above the room's, and what is gained in the end [K].
        time: constant of the approach [s].
        thermometer: that records it.
    """

    rate: float
    start: float
    rise: float
    time: float
    thermometer: Sensor

    def temperature(self, time: float) -> float:
        """[K]."""
        return ROOM + self.start + self.rise * (1 - exp(-time / self.time))

    def force(self, robot: Robot) -> ExtraForce:
        """What the joint's friction loses, as a force in Exudyn, whose joints keep the room's temperature."""
        viscous = friction_at(robot, "joint1", "viscous_friction")
        return _Warm(self, viscous, friction_at(robot, "joint1", "coulomb_friction"))

    def beside(self, recording: Recording, seed: int) -> Recording:
        """The recording with the thermometer's channel."""
        sensor = self.thermometer
        true = np.array([self.temperature(float(t)) for t in recording.time])
        noisy = true + np.random.default_rng([seed, 17]).normal(0, sensor.noise, true.size)
        said = np.round(noisy / sensor.resolution) * sensor.resolution
        return replace(recording, channels={**recording.channels, sensor.channel: said})


@dataclass(frozen=True)
class _Warm(ExtraForce):
    warming: Warming
    viscous: float
    coulomb: float

    def advance(
        self, now: ArmInstant, memory: tuple[float, ...]
    ) -> tuple[Sequence[float], tuple[float, ...]]:
        speed = now.velocity[0]
        friction = -self.viscous * speed - self.coulomb * tanh(speed / TRANSITION)
        above = self.warming.temperature(now.time) - ROOM
        changed = friction * (exp(-self.warming.rate * above) - 1)
        return [changed, *(0.0 for _ in now.velocity[1:])], memory


def warm_up(d: Draw, thermometer: Sensor) -> tuple[EffectUse, Warming]:
    """A motor warms its joint by 10 to 30 K within a recording; friction falls by 1 to 5 % per kelvin."""
    rate = bounded(d.decades(0.01, 0.05))
    warming = Warming(rate, d.even(-5.0, 5.0), d.even(10.0, 30.0), d.even(4.0, 10.0), thermometer)
    return _use("temperature_dependent_friction", "joint1", {"rate": rate}), warming


def _use(effect: str, at: str, values: Values) -> EffectUse:
    return EffectUse.model_validate(
        {"effect": effect, "at": at, **{key: bounded(value) for key, value in values.items()}}
    )


def _joint(d: Draw, scales: Scales) -> str:
    return list(scales)[int(d.chance.integers(len(scales)))]


def _elasticity(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    """Winds up by a half to eight arc minutes under the largest torque."""
    joint = _joint(d, scales)
    stiffness = scales[joint].peak / d.decades(2e-4, 2.5e-3)
    damping = stiffness * d.decades(3e-4, 2e-3)
    return _use("joint_elasticity", joint, {"stiffness": stiffness, "damping": damping})


def _backlash(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    """A third to five arc minutes of play, flanks that give little."""
    joint = _joint(d, scales)
    stiffness = scales[joint].peak / d.decades(2e-4, 6e-4)
    values = {"half_width": d.decades(1e-4, 1.5e-3), "stiffness": stiffness, "damping": 1e-3 * stiffness}
    return _use("backlash", joint, values)


def _hysteresis(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    joint = _joint(d, scales)
    stiffness = scales[joint].peak / d.decades(5e-4, 2.5e-3)
    values = {
        "torque": scales[joint].peak * d.even(0.05, 0.2),
        "travel": d.decades(1e-4, 5e-4),
        "stiffness": stiffness,
        "damping": 6e-4 * stiffness,
    }
    return _use("gear_hysteresis", joint, values)


def _link_flexibility(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    link = robot.links[-1].name
    return _use(
        "link_flexibility", link, {"period": d.decades(0.04, 0.2), "damping_ratio": d.decades(0.005, 0.03)}
    )


def _bending(robot: Robot) -> str:
    return next(link.name for link in robot.links if link.flexible)


def _modal_damping(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    return _use("modal_damping", _bending(robot), {"damping_ratio": d.decades(0.01, 0.1)})


def _stiffening(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    return _use("centrifugal_stiffening", _bending(robot), {"strength": 1.0})


def _base_motion(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    values = {
        "compliance": d.decades(2e-6, 5e-5),
        "arm": d.even(0.3, 0.8),
        "damping": d.decades(5e-4, 5e-3),
        "mass": d.even(20.0, 80.0),
        "inertia": d.even(2.0, 12.0),
    }
    return _use("base_motion", "base", values)


def _contact(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    """A level wall under the tip of the planar arm, met at the lowest points of its way."""
    lower, upper = robot.joints[1].origin[0], 2 * robot.links[1].center_of_mass[0]
    goals = motions(robot)
    assert robot.reference is not None
    times = np.linspace(1.0, robot.reference.duration, LOOKS)
    angles = np.array([[motion(float(t))[0] for motion in goals] for t in times])
    height = lower * np.sin(angles[:, 0]) + upper * np.sin(angles.sum(1))
    depth = d.even(*DEPTHS)
    values = {
        "stiffness": d.even(20.0, 80.0) / depth**1.5,
        "offset": float(height.min()) + depth,
        "damping": d.even(0.1, 0.5),
        "x": upper,
    }
    return _use("contact", robot.links[1].name, values)


def _slosh(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    values = {
        "mass": robot.base.mass * d.even(0.03, 0.12),
        "frequency": d.decades(0.2, 1.0),
        "damping_ratio": d.decades(0.005, 0.05),
        "x": d.even(-0.3, 0.3),
        "z": d.even(-0.3, 0.3),
    }
    return _use("slosh", "base", values)


def _reaction_wheel(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    values = {f"momentum_{axis}": d.sign() * d.decades(1.0, 8.0) for axis in "xyz"}
    values |= {f"torque_{axis}": d.sign() * d.decades(0.02, 0.2) for axis in "xyz"}
    return _use("reaction_wheel", "base", values)


def _gravity(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    """A tilted or wrong field: a twentieth to four tenths of a metre per second squared along each axis."""
    return _use("gravity", "base", {axis: d.sign() * d.decades(0.05, 0.4) for axis in "xyz"})


#: Effects of a gear, which show between two encoders.
GEARS = ("joint_elasticity", "backlash", "gear_hysteresis")
OTHERS: Mapping[str, Callable[[Draw, Robot, Scales], EffectUse]] = MappingProxyType(
    {
        "joint_elasticity": _elasticity,
        "backlash": _backlash,
        "gear_hysteresis": _hysteresis,
        "link_flexibility": _link_flexibility,
        "modal_damping": _modal_damping,
        "centrifugal_stiffening": _stiffening,
        "base_motion": _base_motion,
        "contact": _contact,
        "slosh": _slosh,
        "reaction_wheel": _reaction_wheel,
        "gravity": _gravity,
    }
)
