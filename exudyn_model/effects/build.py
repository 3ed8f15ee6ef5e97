"""From the effects of a robot file to laws, masses and sensor faults; refuses what has no counterpart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields
from types import MappingProxyType
from typing import TypeVar

from exudyn_model.effects import friction
from exudyn_model.effects.base import JointLaw
from robot_model import EffectUse, InputError, Robot, nearest

__all__ = ["JOINT_LAWS", "check_effects", "laws_of"]

#: Effects at a joint, with the class that carries each out.
JOINT_LAWS: Mapping[str, type[JointLaw]] = MappingProxyType(
    {
        "viscous_friction": friction.ViscousFriction,
        "coulomb_friction": friction.CoulombFriction,
        "stribeck_friction": friction.StribeckFriction,
        "lugre_friction": friction.LuGreFriction,
        "asymmetric_friction": friction.AsymmetricFriction,
        "position_dependent_friction": friction.PositionDependentFriction,
        "temperature_dependent_friction": friction.TemperatureDependentFriction,
    }
)

T = TypeVar("T")


def check_effects(robot: Robot) -> None:
    """Raise `InputError` for an effect that the Exudyn model cannot carry out."""
    for use in robot.effects:
        if use.effect not in JOINT_LAWS:
            raise InputError(
                f"robot '{robot.name}': the Exudyn engine has no counterpart of effect '{use.effect}' at "
                f"'{use.at}'{nearest(use.effect, JOINT_LAWS)}."
            )


def laws_of(robot: Robot) -> list[list[JointLaw]]:
    """The laws at each moving joint, in the order of the file."""
    names = [joint.name for joint in robot.moving_joints]
    laws: list[list[JointLaw]] = [[] for _ in names]
    for use in robot.effects:
        if use.effect in JOINT_LAWS:
            laws[_index(robot, use, names)].append(made(robot, use, JOINT_LAWS[use.effect]))
    return laws


def made(robot: Robot, use: EffectUse, kind: type[T]) -> T:
    """An instance of `kind`, a dataclass whose fields are the effect's parameters."""
    where = f"robot '{robot.name}', effect '{use.effect}' at '{use.at}'"
    known = {item.name: item for item in fields(kind)}  # type: ignore[arg-type]
    for name in use.parameters:
        if name not in known:
            raise InputError(f"{where}: unknown parameter '{name}'{nearest(name, known)}.")
    for name, item in known.items():
        if name not in use.parameters and item.default is MISSING:
            raise InputError(f"{where}: parameter '{name}' is missing.")
    return kind(**use.parameters)


def _index(robot: Robot, use: EffectUse, names: Iterable[str]) -> int:
    places = list(names)
    if use.at not in places:
        raise InputError(
            f"robot '{robot.name}', effect '{use.effect}': '{use.at}' is no moving joint{nearest(use.at, places)}."
        )
    return places.index(use.at)
