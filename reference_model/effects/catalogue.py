"""All known effects: those of this package, and those a user's package adds.

An installed package adds effects through the entry-point group ``missing_physics.effects``, each entry
naming an `Effect` class.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from types import MappingProxyType

import reference_model.effects as package
from reference_model.effects.base import BodyEffect, Effect, GearEffect, SensorEffect
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.structure import StructureEffect
from robot_model import InputError, Robot, nearest

__all__ = ["UsedEffect", "catalogue", "get_effect", "used_effects"]

ENTRY_POINT_GROUP = "missing_physics.effects"


@cache
def catalogue() -> Mapping[str, Effect]:
    """Effect id to its instance, in alphabetical order."""
    found: dict[str, Effect] = {}
    for module_info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"{package.__name__}.{module_info.name}")
        for value in vars(module).values():
            if isinstance(value, type) and issubclass(value, Effect) and hasattr(value, "id"):
                found[value.id] = value()
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        effect = entry.load()()
        found[effect.id] = effect
    return MappingProxyType(dict(sorted(found.items())))


def get_effect(effect_id: str) -> Effect:
    """The effect of that id; raises `InputError` that suggests the nearest one."""
    try:
        return catalogue()[effect_id]
    except KeyError:
        raise InputError(f"there is no effect '{effect_id}'{nearest(effect_id, catalogue())}.") from None


@dataclass(frozen=True)
class UsedEffect:
    """An effect at a place with all its parameters.

    Attributes:
        effect: the catalogue entry.
        at: joint, motor of a transmission, link, `base` or channel.
        parameters: every parameter's value.
    """

    effect: Effect
    at: str
    parameters: Mapping[str, float]


def used_effects(robot: Robot) -> tuple[UsedEffect, ...]:
    """The robot's effects, checked against the catalogue.

    Raises:
        InputError: unknown id, place or parameter, a value out of bounds, a missing parameter, or values that
            exclude each other.
    """
    return tuple(_checked(robot, use.effect, use.at, use.parameters) for use in robot.effects)


def _checked(robot: Robot, effect_id: str, at: str, given: Mapping[str, float]) -> UsedEffect:
    effect = get_effect(effect_id)
    where = f"robot '{robot.name}', effect '{effect_id}' at '{at}'"
    places = _places(robot, effect)
    if places is not None and at not in places:
        raise InputError(f"{where}: it can sit at {', '.join(sorted(places))}{nearest(at, places)}.")
    names = [parameter.name for parameter in effect.parameters]
    for name in given:
        if name not in names:
            raise InputError(f"{where}: unknown parameter '{name}'{nearest(name, names)}.")
    values = {**effect.defaults(), **given}
    for parameter in effect.parameters:
        if parameter.name not in values:
            raise InputError(f"{where}: parameter '{parameter.name}' [{parameter.unit}] is missing.")
        value = values[parameter.name]
        if not parameter.lower <= value <= parameter.upper:
            raise InputError(
                f"{where}: {parameter.name} = {value:g} {parameter.unit} is outside "
                f"{parameter.lower:g} to {parameter.upper:g}; give it in this unit and inside these limits."
            )
    if wrong := effect.contradiction(values):
        raise InputError(f"{where}: {wrong}.")
    return UsedEffect(effect, at, MappingProxyType(values))


def _places(robot: Robot, effect: Effect) -> set[str] | None:
    """Where the effect may sit in this robot; None when it is a channel."""
    if isinstance(effect, SensorEffect):
        return None
    if effect.place == "base":
        return {"base"}
    if isinstance(effect, StructureEffect | ForceEffect):
        return {link.name for link in robot.links}
    if isinstance(effect, BodyEffect):
        return {link.name for link in robot.links} | {"base"}
    if isinstance(effect, GearEffect):
        return {drive.name for drive in robot.drives}
    return {joint.name for joint in robot.moving_joints} | {motor.name for motor in robot.motors}
