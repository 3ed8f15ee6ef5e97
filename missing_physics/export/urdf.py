"""A robot as URDF, with the parts that it can hold: bodies, joints, damping and dry friction."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from xml.etree import ElementTree

from missing_physics.export.content import Content
from missing_physics.export.figures import figure, figures
from robot_model import Joint

__all__ = ["unsaid", "urdf_of"]


def urdf_of(content: Content) -> str:
    """The model's text, its root the base, on a link `world` where the base is fixed elsewhere than there."""
    robot = content.robot
    root = ElementTree.Element("robot", name=robot.name)
    placed = robot.base.kind == "fixed" and any((*robot.base.position, *robot.base.rpy))
    if placed:
        ElementTree.SubElement(root, "link", name="world")
        mount = ElementTree.SubElement(root, "joint", name="world_to_base", type="fixed")
        ElementTree.SubElement(mount, "parent", link="world")
        ElementTree.SubElement(mount, "child", link="base")
        _origin(mount, robot.base.position, robot.base.rpy)
    for name in ("base", *(link.name for link in robot.links)):
        link = ElementTree.SubElement(root, "link", name=name)
        body = content.bodies.get(name)
        if body is not None and body.mass > 0.0:
            inertial = ElementTree.SubElement(link, "inertial")
            _origin(inertial, body.centre, (0.0, 0.0, 0.0))
            ElementTree.SubElement(inertial, "mass", value=figure(body.mass))
            pairs = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
            values = {key: figure(body.inertia[pair]) for key, pair in pairs.items()}
            ElementTree.SubElement(inertial, "inertia", values)
    for joint in robot.tree:
        _joint(root, joint, content)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def unsaid(content: Content) -> Iterator[str]:
    """Parameters that URDF cannot hold, a sentence each."""
    if any(content.gravity):
        yield f"gravity [m/s^2]: {figures(content.gravity)}"
    for transmission in content.robot.transmissions:
        yield f"the transmission {transmission.name}, so that its joints are driven one by one there"
    for name, joint in (*content.joints.items(), *content.motors.items()):
        unsupported = {
            "armature": joint.armature,
            "spring stiffness": joint.stiffness,
            "torque offset": joint.offset,
            "torque gain": joint.gain - 1.0 and joint.gain,
        }
        if name in content.motors:
            unsupported |= {"damping": joint.damping, "dry friction": joint.frictionloss}
        for key, value in unsupported.items():
            if value:
                yield f"{key} of {name}: {figure(value)}"


def _joint(root: ElementTree.Element, joint: Joint, content: Content) -> None:
    kinds = {"revolute": "revolute" if joint.position_limits else "continuous"}
    element = ElementTree.SubElement(root, "joint", name=joint.name, type=kinds.get(joint.kind, joint.kind))
    _origin(element, joint.origin, joint.rpy)
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    if joint.kind == "fixed":
        return
    numbers = content.joints[joint.name]
    ElementTree.SubElement(element, "axis", xyz=figures(joint.unit_axis))
    if numbers.damping or numbers.frictionloss:
        ElementTree.SubElement(
            element, "dynamics", damping=figure(numbers.damping), friction=figure(numbers.frictionloss)
        )
    lower, upper = joint.position_limits or (-LONGEST, LONGEST)
    limit = {
        "effort": figure(min(numbers.limit, LARGEST)),
        "velocity": figure(joint.velocity_limit or LARGEST),
    }
    if joint.position_limits or joint.kind == "prismatic":
        limit |= {"lower": figure(lower), "upper": figure(upper)}
    if joint.position_limits or joint.kind == "prismatic" or math.isfinite(numbers.limit):
        ElementTree.SubElement(element, "limit", limit)


#: Limits that URDF requires, where a robot file has none: travel [m], torque and speed.
LONGEST = 1e3
LARGEST = 1e6


def _origin(parent: ElementTree.Element, place: Iterable[float], rpy: Iterable[float]) -> None:
    ElementTree.SubElement(parent, "origin", xyz=figures(place), rpy=figures(rpy))
