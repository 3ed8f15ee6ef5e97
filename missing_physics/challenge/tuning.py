"""What was tuned in a nominal robot, and whether a named change takes it back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from missing_physics.challenge.ranges import inertial_numbers
from missing_physics.challenge.truth import Design
from robot_model import Joint, Robot

__all__ = ["takes_back", "tunable"]

#: What was changed by less, relative to itself, was not tuned.
LEAST = 0.01
PAIRS = ("xx", "yy", "zz", "xy", "xz", "yz")
GROUPS = (
    ("mass",),
    tuple(f"first_moment_{axis}" for axis in "xyz"),
    tuple(f"inertia_{pair}" for pair in PAIRS),
)


def tunable(robot: Robot) -> dict[str, float]:
    """Masses of links, rotors and friction by link, joint and `ID@PLACE`."""
    found = {link.name: link.mass for link in robot.links}
    found |= {joint.name: joint.actuator.rotor_inertia for joint in robot.moving_joints if joint.actuator}
    return found | {f"{use.effect}@{use.at}": next(iter(use.parameters.values())) for use in robot.effects}


def takes_back(design: Design, given: Robot, item: Mapping[str, Any]) -> bool:
    """Whether a finding changes something that was tuned, and in the direction of the untuned robot.

    Friction of the file is told as a whole, in the place of the file's number, and the masses of a link by
    what a payload, or all inertial numbers together, add to them. A rotor counts as part of the link that it
    turns.
    """
    if design.family != "tuned_away":
        return False
    effect, at = str(item["effect"]), str(item["location"])
    values = {name: float(estimate["value"]) for name, estimate in item["parameters"].items()}
    before, after = tunable(design.nominal), tunable(given)
    changes = {name: before[name] - after[name] for name in before}
    tuned = {name: change for name, change in changes.items() if abs(change) > LEAST * after[name]}
    if (label := f"{effect}@{at}") in tuned:
        use = next(use for use in given.effects if f"{use.effect}@{use.at}" == label)
        own = use.parameters
        return any((value - own.get(name, value)) * tuned[label] > 0 for name, value in values.items())
    if effect not in ("inertia", "payload") or at not in {link.name for link in given.links}:
        return False
    turning = next((joint for joint in given.moving_joints if joint.child == at), None)
    rotor = tuned.get(turning.name, 0.0) if turning and turning.actuator else 0.0
    if at not in tuned and not rotor:
        return False
    link = given.link(at)
    if effect == "payload":
        return values.get("mass", 0.0) * (changes[at] if at in tuned else rotor) > 0
    own = inertial_numbers(link)
    wanted = {name: changes[at] / link.mass * value if link.mass else 0.0 for name, value in own.items()}
    for name, value in _turned(turning, rotor).items() if turning and rotor else ():
        wanted[name] += value
    return sum(_along(group, values, wanted, own) for group in GROUPS) > 0


def _turned(joint: Joint, rotor: float) -> dict[str, float]:
    """What a rotor is to the body that it moves: inertia about the joint's axis, or mass."""
    assert joint.actuator is not None
    seen = rotor * joint.actuator.gear_ratio**2
    if joint.kind == "prismatic":
        return {"mass": seen}
    axis = joint.unit_axis
    moments = seen * np.outer(axis, axis)
    return {f"inertia_{p}": float(moments["xyz".index(p[0]), "xyz".index(p[1])]) for p in PAIRS}


def _along(
    group: tuple[str, ...], values: Mapping[str, float], wanted: Mapping[str, float], own: Mapping[str, float]
) -> float:
    """How far the named change goes with the wanted one, relative to the body's own numbers."""
    size = sum(max(abs(own[name]), abs(wanted[name])) ** 2 for name in group)
    return sum(values.get(name, 0.0) * wanted[name] for name in group) / size if size else 0.0
