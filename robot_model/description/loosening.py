"""A robot with clearances as one with more joints: two slides perpendicular to each joint with clearance.

Between the parent and the joint are two massless links, moved by passive prismatic joints
`JOINT_clearance_x` and `JOINT_clearance_y`, along two axes perpendicular to the joint's own. They come at the
end of the file's order. A joint controller gets zero gains for them: it assumes an ideal joint.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_model.description.control import ComputedTorque, JointPD
from robot_model.description.types import Joint, Link, Robot
from robot_model.input.errors import InputError
from robot_model.input.fields import Vector

__all__ = ["SLIDES", "loosened"]

#: Ends of the names of the slides.
SLIDES = ("clearance_x", "clearance_y")


def loosened(robot: Robot) -> Robot:
    """The robot with the slides of its joints with clearance; unchanged if it has none or has them already.

    Raises:
        InputError: the name of a slide is taken.
    """
    names = {joint.name for joint in robot.joints} | {link.name for link in robot.links}
    loose = [joint for joint in robot.joints if joint.clearance is not None]
    if not loose or all(f"{joint.name}_{SLIDES[0]}" in names for joint in loose):
        return robot
    joints, slides, links = list(robot.joints), list[Joint](), list(robot.links)
    for joint in loose:
        for end in SLIDES:
            if f"{joint.name}_{end}" in names:
                raise InputError(
                    f"robot '{robot.name}': the name '{joint.name}_{end}' is that of the clearance of joint "
                    f"'{joint.name}'; rename the part that has it."
                )
        first, second = (f"{joint.name}_{end}" for end in SLIDES)
        x, y = _across(joint)
        place: dict[str, Any] = {"parent": joint.parent, "origin": joint.origin, "rpy": joint.rpy}
        slides.append(Joint(name=first, kind="prismatic", child=f"{first}_part", axis=x, **place))
        slides.append(
            Joint(name=second, kind="prismatic", parent=f"{first}_part", child=f"{second}_part", axis=y)
        )
        links += [Link(name=f"{first}_part"), Link(name=f"{second}_part")]
        moved = {"parent": f"{second}_part", "origin": (0.0, 0.0, 0.0), "rpy": (0.0, 0.0, 0.0)}
        joints[joints.index(joint)] = joint.model_copy(update=moved)
    changes = {"joints": (*joints, *slides), "links": tuple(links), "controller": _gained(robot, len(slides))}
    return robot.model_copy(update=changes)


def _across(joint: Joint) -> tuple[Vector, Vector]:
    """Two unit vectors that make a right-handed triple with the joint's axis, in the joint's frame."""
    axis = joint.unit_axis
    start = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = start - (start @ axis) * axis
    x = x / np.linalg.norm(x)
    y = np.cross(axis, x)
    return (float(x[0]), float(x[1]), float(x[2])), (float(y[0]), float(y[1]), float(y[2]))


def _gained(robot: Robot, more: int) -> Any:
    """The controller with gains for this number of additional joints."""
    controller, count = robot.controller, len(robot.moving_joints)
    believes = isinstance(controller, ComputedTorque | JointPD)
    changes: dict[str, Any] = {}
    for key in type(controller).model_fields:
        value = getattr(controller, key)
        if key in ("kp", "kd", "ki", "coulomb_feedforward", "load_feedforward") and believes:
            given = value if isinstance(value, tuple) else (value,) * count
            changes[key] = (*given, *(0.0,) * more)
        elif isinstance(value, tuple):
            changes[key] = (*value, *(value[-1],) * more)
    return controller.model_copy(update=changes)
