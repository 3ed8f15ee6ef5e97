"""Errors of a robot file: its masses, inertias, rotors and friction are not quite the machine's.

Each number is off by a factor of its own. A body's inertia about its centre of mass is scaled as a whole, so
that a realisable body stays one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from missing_physics.challenge.cases.ranges import Draw
from robot_model import Robot

__all__ = ["draw_file_errors", "with_file_errors"]

#: Size of an error, relative to the machine's number: what CAD data and catalogues are commonly off by.
OFF = (0.01, 0.1)


def draw_file_errors(robot: Robot, d: Draw) -> dict[str, float]:
    """Relative error of each number of `robot` that a file may have wrong, by the number's name."""
    return {name: d.sign() * d.decades(*OFF) for name in _names(robot)}


def _names(robot: Robot) -> Iterator[str]:
    bodies = [("base", robot.base)] if robot.base.kind == "free" else []
    for name, body in [*bodies, *((link.name, link) for link in robot.links)]:
        if body.mass > 0:
            yield f"{name}.mass"
        if any(body.inertia):
            yield f"{name}.inertia"
    for link in robot.links:
        if link.beam is not None:
            yield f"{link.name}.density"
            if link.beam.tip.mass > 0:
                yield f"{link.name}.tip_mass"
    for joint in robot.moving_joints:
        if joint.actuator and joint.actuator.rotor_inertia > 0:
            yield f"{joint.name}.rotor_inertia"
    for use in robot.effects:
        yield f"{use.effect}@{use.at}"


def with_file_errors(robot: Robot, errors: Mapping[str, float]) -> Robot:
    """`robot` as a file describes it that has these errors; itself where there are none."""
    if not errors:
        return robot
    data = robot.model_dump(mode="python")
    factor = {name: 1 + error for name, error in errors.items()}
    for name, body in [("base", data["base"]), *((link["name"], link) for link in data["links"])]:
        body["mass"] *= factor.get(f"{name}.mass", 1.0)
        body["inertia"] = tuple(factor.get(f"{name}.inertia", 1.0) * x for x in body["inertia"])
        if body.get("beam"):
            _with_beam_errors(body["beam"], name, factor)
    for joint in data["joints"]:
        if joint["actuator"]:
            joint["actuator"]["rotor_inertia"] *= factor.get(f"{joint['name']}.rotor_inertia", 1.0)
    for use in data["effects"]:
        own = factor.get(f"{use['effect']}@{use['at']}", 1.0)
        use.update({key: own * value for key, value in use.items() if key not in ("effect", "at")})
    return Robot.model_validate(data)


def _with_beam_errors(beam: dict[str, Any], link: str, factor: Mapping[str, float]) -> None:
    beam["density"] *= factor.get(f"{link}.density", 1.0)
    beam["tip"]["mass"] *= factor.get(f"{link}.tip_mass", 1.0)
