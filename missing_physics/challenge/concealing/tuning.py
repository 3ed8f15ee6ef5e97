"""Errors of a robot file, tuned or not, and whether a finding corrects them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from missing_physics.challenge.cases.ranges import inertial_numbers
from missing_physics.challenge.cases.truth import Design
from robot_model import Base, Joint, Link, Robot

__all__ = ["corrects_file", "may_correct_file", "tunable"]

#: A parameter with a smaller relative error counts as correct: half of the smallest error of a file.
LEAST = 0.005
PAIRS = ("xx", "yy", "zz", "xy", "xz", "yz")
GROUPS = (
    ("mass",),
    tuple(f"first_moment_{axis}" for axis in "xyz"),
    tuple(f"inertia_{pair}" for pair in PAIRS),
)


def tunable(robot: Robot) -> dict[str, float]:
    """Masses of links, rotor inertias and friction by link, joint and `ID@PLACE`."""
    found = {link.name: link.mass for link in robot.links}
    found |= {joint.name: joint.actuator.rotor_inertia for joint in robot.moving_joints if joint.actuator}
    return found | {f"{use.effect}@{use.at}": next(iter(use.parameters.values())) for use in robot.effects}


def corrects_file(design: Design, given: Robot, item: Mapping[str, Any]) -> bool:
    """Whether a finding corrects a wrong parameter of the robot file towards the machine's.

    Wrong parameters are tuned ones and errors of the file. A finding of friction replaces the whole
    coefficient of the file; a payload, or all inertial parameters together, are added to those of the
    body. A rotor counts as part of the link that it turns.
    """
    effect, at = str(item["effect"]), str(item["location"])
    values = {name: float(estimate["value"]) for name, estimate in item["parameters"].items()}
    wrong = _wrong_parameters(design.nominal, given)
    if (label := f"{effect}@{at}") in wrong:
        use = next(use for use in given.effects if f"{use.effect}@{use.at}" == label)
        own = use.parameters
        return any((value - own.get(name, value)) * wrong[label] > 0 for name, value in values.items())
    file, real = _body(given, at), _body(design.nominal, at)
    if effect not in ("inertia", "payload") or file is None or real is None:
        return False
    turning = next((joint for joint in given.moving_joints if joint.child == at), None)
    rotor = wrong.get(turning.name, 0.0) if turning and turning.actuator else 0.0
    if effect == "payload":
        heavier = _mass(real) - _mass(file)
        return values.get("mass", 0.0) * (heavier if abs(heavier) > LEAST * _mass(file) else rotor) > 0
    wanted = {name: value - inertial_numbers(file)[name] for name, value in inertial_numbers(real).items()}
    for name, value in _rotor_inertia(turning, rotor).items() if turning and rotor else ():
        wanted[name] += value
    return _same_direction(values, wanted, inertial_numbers(file))


def may_correct_file(design: Design, given: Robot, label: str) -> bool:
    """Whether an effect at a place, of unknown size, may correct a wrong parameter of the robot file."""
    effect, _, at = label.partition("@")
    file, real = _body(given, at), _body(design.nominal, at)
    if file is None or real is None or effect not in ("inertia", "payload"):
        return label in _wrong_parameters(design.nominal, given)
    turned = {joint.name for joint in given.moving_joints if joint.child == at}
    return file != real or bool(turned & set(_wrong_parameters(design.nominal, given)))


def _wrong_parameters(real: Robot, file: Robot) -> dict[str, float]:
    """The machine's parameter minus the file's, for wrong ones; names as in `tunable`."""
    before, after = tunable(real), tunable(file)
    changes = {name: before[name] - after[name] for name in before}
    return {name: change for name, change in changes.items() if abs(change) > LEAST * after[name]}


def _same_direction(
    values: Mapping[str, float], wanted: Mapping[str, float], own: Mapping[str, float]
) -> bool:
    """Whether a change of inertial parameters has the direction of the wanted one, if there is one."""
    if not any(_size(group, wanted) > LEAST * _size(group, own) for group in GROUPS):
        return False
    return sum(_projection(group, values, wanted, own) for group in GROUPS) > 0


def _body(robot: Robot, name: str) -> Base | Link | None:
    if name == "base":
        return robot.base
    return next((link for link in robot.links if link.name == name), None)


def _mass(body: Base | Link) -> float:
    """Mass [kg], including that of a beam and of its tip."""
    beam = getattr(body, "beam", None)
    return body.mass + (beam.mass + beam.tip.mass if beam else 0.0)


def _size(group: tuple[str, ...], numbers: Mapping[str, float]) -> float:
    return float(np.linalg.norm([numbers[name] for name in group]))


def _rotor_inertia(joint: Joint, rotor: float) -> dict[str, float]:
    """Contribution of a rotor to the body that it moves: inertia about the joint's axis, or mass."""
    assert joint.actuator is not None
    seen = rotor * joint.actuator.gear_ratio**2
    if joint.kind == "prismatic":
        return {"mass": seen}
    axis = joint.unit_axis
    moments = seen * np.outer(axis, axis)
    return {f"inertia_{p}": float(moments["xyz".index(p[0]), "xyz".index(p[1])]) for p in PAIRS}


def _projection(
    group: tuple[str, ...], values: Mapping[str, float], wanted: Mapping[str, float], own: Mapping[str, float]
) -> float:
    """Projection of a change onto the wanted one, relative to the body's own parameters."""
    size = sum(max(abs(own[name]), abs(wanted[name])) ** 2 for name in group)
    return sum(values.get(name, 0.0) * wanted[name] for name in group) / size if size else 0.0
