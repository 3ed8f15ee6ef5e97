"""A robot file with other inertial parameters: masses, centres, inertias and rotors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from missing_physics.bodies.realisable import BODY_NUMBERS, nearest, parts_of
from reference_model.dynamics.inertial import body_names, inertial_names, nominal_inertial
from robot_model import Link, Robot

__all__ = ["as_real_bodies", "body_of", "rounded", "with_numbers"]

Array = NDArray[np.float64]

#: Digits kept of a number in the robot file.
DIGITS = 8
#: A change by a parameter's typical size counts as much as a prediction error that starts to matter.
CLOSE = 1.0
#: Final weight of the barrier that keeps bodies consistent: compared with `CLOSE` it keeps them off the edge
#: by a ten thousandth of their size.
LAST = 1e-8


def as_real_bodies(
    robot: Robot, change: Array, *, scale: Array, free: NDArray[np.bool_], weight: Array
) -> Robot | None:
    """`robot` with changed inertial parameters, or with consistent ones that predict nearly the same.

    Data determine only combinations of the parameters. Where the change is not physically consistent, or a
    robot file cannot hold it, the predictions stay as close to it as consistent bodies allow, and among these
    the parameters stay as close as possible to the nominal ones.

    Args:
        robot: the description; P parameters in the order of `inertial_names`.
        change: added to each parameter, zero unless it is free, shape (P,).
        scale: typical sizes, shape (P,).
        free: which may change, shape (P,).
        weight: cost |weight x|^2 of the prediction error due to a change x, one where the error starts to
            matter, shape (M, P).

    Returns:
        None where there are no such bodies.
    """
    names, before = np.array(inertial_names(robot)), nominal_inertial(robot)
    held = np.array([_holds(robot, name) for name in names])
    if not change[~held].any():
        exact = _validated(robot, dict(zip(names[free], (before + change)[free])))
        if exact is not None:
            return exact
    free = free & held
    parts = list(parts_of(list(names), scale, before, free))
    seen, described = weight[:, free] * scale[free], (before / scale)[free]
    asked = weight @ change + seen @ described
    found = nearest(parts, described, seen, asked, close=CLOSE, last=LAST)
    return None if found is None else _validated(robot, dict(zip(names[free], found * scale[free])))


def with_numbers(robot: Robot, numbers: Mapping[str, float]) -> Robot:
    """`robot` with other values of some of its inertial parameters.

    Raises:
        ValidationError: they are not physically consistent.
    """
    every = {**dict(zip(inertial_names(robot), nominal_inertial(robot))), **numbers}
    changed = {name.split(".")[0] for name in numbers}
    data = robot.model_dump(mode="python")
    bodies = dict(zip((link.name for link in robot.links), data["links"]))
    bodies["base"] = data["base"]
    for body in body_names(robot):
        if body in changed:
            bodies[body].update(body_of(every, body))
    rotors = {name.split(".")[0]: v for name, v in numbers.items() if name.endswith(".reflected_inertia")}
    for joint in data["joints"]:
        rotor = rotors.get(joint["name"], 0.0)
        if rotor or (joint["actuator"] and joint["name"] in rotors):
            joint["actuator"] = _with_rotor(joint["actuator"], rotor)
    if any(rotors.values()) and not _actuated(robot):
        # one actuator among joints without any would mean that the others are not driven
        for joint in data["joints"]:
            moves = robot.joint(joint["name"]) in robot.moving_joints
            joint["actuator"] = joint["actuator"] or ({} if moves else None)
    return Robot.model_validate(data)


def body_of(numbers: Mapping[str, float], body: str) -> dict[str, object]:
    """Keys of a body in a robot file, from its ten parameters."""
    mass, *moment = (numbers[f"{body}.{number}"] for number in BODY_NUMBERS[:4])
    xx, yy, zz, xy, xz, yz = (numbers[f"{body}.{number}"] for number in BODY_NUMBERS[4:])
    centre = np.array(moment) / mass if mass > 0 else np.zeros(3)
    about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    central = about_origin - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return {
        "mass": rounded(mass),
        "center_of_mass": tuple(rounded(c) for c in centre),
        "inertia": tuple(rounded(central[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))),
    }


def rounded(value: float) -> float:
    """A number with as many digits as a robot file gets."""
    return float(f"{float(value):.{DIGITS}g}")


def _validated(robot: Robot, numbers: Mapping[str, float]) -> Robot | None:
    try:
        return with_numbers(robot, numbers)
    except ValidationError:
        return None


def _with_rotor(actuator: dict[str, Any] | None, reflected: float) -> dict[str, Any]:
    """An actuator whose rotor has an inertia of `reflected` at the joint [kg m^2 or kg]."""
    kept = actuator or {}
    return {**kept, "rotor_inertia": rounded(reflected / kept.get("gear_ratio", 1.0) ** 2)}


def _actuated(robot: Robot) -> bool:
    return any(joint.actuator is not None for joint in robot.moving_joints)


def _holds(robot: Robot, name: str) -> bool:
    """Whether a robot file can hold another value of an inertial parameter.

    A joint that nothing drives has no rotor, a body with free modes no rigid hub.
    """
    place, _, number = name.partition(".")
    if number == "reflected_inertia":
        return not _actuated(robot) or robot.joint(place).actuator is not None
    hollow = [link.name for link in robot.links if _hollow(link)]
    return place not in hollow


def _hollow(link: Link) -> bool:
    flexible = link.beam or link.modal
    return flexible is not None and flexible.boundary == "free"
