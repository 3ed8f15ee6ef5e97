"""Parameter ranges of effects that the challenge draws differently, and of those beyond a single joint.

Relative to the robot and its motion, like `missing_physics.challenge.cases.ranges`; credible values are those
of the catalogue.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from missing_physics.challenge.cases.ranges import Draw, Scale, bounded
from missing_physics.challenge.cases.truth import Warming
from missing_physics.challenge.draws.hiding import TILT
from missing_physics.challenge.draws.warming import EFFECT
from missing_physics.challenge.draws.wider_ranges import GEARS as IN_GEARS
from missing_physics.challenge.draws.wider_ranges import STRUCTURES
from robot_model import EffectUse, Robot

__all__ = ["GEARS", "OTHERS", "warm_up"]

#: Gear effects, observable between two encoders.
GEARS = tuple(IN_GEARS)

Values = Mapping[str, float]
Scales = Mapping[str, Scale]


def warm_up(d: Draw, *, noise: float, resolution: float) -> tuple[EffectUse, Warming]:
    """A motor heats its joint by 10 to 30 K within a recording; friction decreases by 1 to 5 % per kelvin.

    `noise` and `resolution` are those of the thermometer at the joint [K].
    """
    rate = bounded(d.decades(0.01, 0.05))
    ways = {"start": d.even(-5.0, 5.0), "rise": d.even(10.0, 30.0), "time": d.even(4.0, 10.0)}
    return _use(EFFECT, "joint1", {"rate": rate}), Warming(
        joint="joint1", **ways, noise=noise, resolution=resolution
    )


def _use(effect: str, at: str, values: Values) -> EffectUse:
    return EffectUse.model_validate(
        {"effect": effect, "at": at, **{key: bounded(value) for key, value in values.items()}}
    )


def _joint(d: Draw, scales: Scales) -> str:
    return list(scales)[int(d.chance.integers(len(scales)))]


def _bending(robot: Robot) -> str:
    return next(link.name for link in robot.links if link.flexible)


def _stiffening(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    return _use("centrifugal_stiffening", _bending(robot), {"strength": 1.0})


def _gravity(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
    """A tilted field, as the challenge draws it."""
    return _use("gravity", "base", {axis: d.sign() * d.decades(*TILT) for axis in "xyz"})


def _gear(effect: str) -> Callable[[Draw, Robot, Scales], EffectUse]:
    def drawn(d: Draw, robot: Robot, scales: Scales) -> EffectUse:
        joint = _joint(d, scales)
        return IN_GEARS[effect](d, joint, scales[joint])

    return drawn


def _structure(effect: str) -> Callable[[Draw, Robot, Scales], EffectUse]:
    return lambda d, robot, scales: STRUCTURES[effect](d, robot)


OTHERS: Mapping[str, Callable[[Draw, Robot, Scales], EffectUse]] = MappingProxyType(
    {
        **{effect: _gear(effect) for effect in GEARS},
        **{effect: _structure(effect) for effect in STRUCTURES},
        "centrifugal_stiffening": _stiffening,
        "gravity": _gravity,
    }
)
