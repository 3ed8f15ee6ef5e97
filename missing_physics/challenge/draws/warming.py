"""A joint that warms while it runs, and the thermometer on it.

Neither engine has a joint whose temperature changes: in Exudyn what its friction loses is a force besides,
and what the thermometer says is a channel besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import exp, tanh

import numpy as np

from exudyn_model import ArmInstant, ExtraForce
from missing_physics.challenge.cases.ranges import Draw
from missing_physics.challenge.cases.truth import Warming
from missing_physics.challenge.draws.robots import friction_at
from robot_model import Recording, Robot

__all__ = ["EFFECT", "ROOM", "draw_warming", "fading", "temperature", "warmed", "with_thermometer"]

EFFECT = "temperature_dependent_friction"
#: Temperature at which friction laws hold as given [K].
ROOM = 293.15
#: Speed over which Coulomb friction passes through zero [rad/s or m/s].
TRANSITION = 1e-4


def draw_warming(joint: str, d: Draw) -> Warming:
    """10 to 30 K within some seconds: much for a motor, so that a short recording shows it at all."""
    return Warming(
        joint=joint,
        start=d.even(-5.0, 5.0),
        rise=d.even(10.0, 30.0),
        time=d.even(4.0, 10.0),
        noise=d.decades(0.02, 0.1),
        resolution=d.decades(0.05, 0.2),
    )


def temperature(warming: Warming, time: float) -> float:
    """[K] at a time [s]."""
    return ROOM + warming.start + warming.rise * (1 - exp(-time / warming.time))


def warmed(warming: Warming, recording: Recording) -> Recording:
    """The recording with the joint's true temperature."""
    true = np.array([temperature(warming, float(t)) for t in recording.time])
    return replace(recording, channels={**recording.channels, f"{warming.joint}.temperature": true})


def with_thermometer(warming: Warming, exact: Recording, recording: Recording, seed: int) -> Recording:
    """`recording` with what the thermometer says of `exact`."""
    channel = f"{warming.joint}.temperature"
    noise = np.random.default_rng([seed, 17]).normal(0, warming.noise, len(exact.time))
    said = np.round((exact[channel] + noise) / warming.resolution) * warming.resolution
    return replace(recording, channels={**recording.channels, channel: said})


def fading(warming: Warming, robot: Robot, rate: float) -> ExtraForce:
    """What the viscous and Coulomb friction of `robot` lose at a relative `rate` per kelvin [1/K]."""
    place = [joint.name for joint in robot.moving_joints].index(warming.joint)
    viscous, coulomb = (
        friction_at(robot, warming.joint, f"{kind}_friction") for kind in ("viscous", "coulomb")
    )
    return _Fading(warming, rate, place, viscous, coulomb)


@dataclass(frozen=True)
class _Fading(ExtraForce):
    warming: Warming
    rate: float
    place: int
    viscous: float
    coulomb: float

    def advance(
        self, now: ArmInstant, memory: tuple[float, ...]
    ) -> tuple[Sequence[float], tuple[float, ...]]:
        speed = now.velocity[self.place]
        friction = -self.viscous * speed - self.coulomb * tanh(speed / TRANSITION)
        lost = friction * (exp(-self.rate * (temperature(self.warming, now.time) - ROOM)) - 1)
        return [lost if k == self.place else 0.0 for k in range(len(now.velocity))], memory
