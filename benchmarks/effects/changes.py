"""Changes of a varied robot by a study before an effect is hidden in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from benchmarks.effects.cases import with_motor_encoders
from robot_model import Robot

__all__ = ["CHANGES"]


def _weightless(robot: Robot) -> Robot:
    """In orbit, or moving on a level plane."""
    return robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)})


def _blind_base(robot: Robot) -> Robot:
    """Without gyro and attitude: momentum gives no information."""
    kept = tuple(sensor for sensor in robot.sensors if not sensor.channel.startswith("base."))
    return robot.model_copy(update={"sensors": kept})


def _frictionless(robot: Robot) -> Robot:
    return robot.model_copy(update={"effects": ()})


#: Changes by key.
CHANGES: Mapping[str, Callable[[Robot], Robot]] = MappingProxyType(
    {
        "motor encoders": with_motor_encoders,
        "weightless": _weightless,
        "no momentum": lambda robot: _blind_base(_weightless(robot)),
        "weightless, no friction": lambda robot: _frictionless(_weightless(robot)),
    }
)
