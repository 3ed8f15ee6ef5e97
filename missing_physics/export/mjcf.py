"""A robot as an MJCF model, which MuJoCo runs."""

from __future__ import annotations

import math
from xml.etree import ElementTree

from missing_physics.export.content import BodyNumbers, Content, JointNumbers
from missing_physics.export.figures import figure, figures
from robot_model import Drive, InputError, Joint, Transmission

__all__ = ["STICKING", "mjcf_of"]

#: Moment of inertia of bodies for which the robot file has none, since MuJoCo divides by it [kg m^2].
SMALLEST_INERTIA = "1e-12"
#: Time constant of dry friction as a soft constraint [s] and its damping ratio: the least that MuJoCo takes
#: at its usual step of 2 ms. With the usual 20 ms the torque is too low up to some hundredths of a rad/s.
STICKING = "0.004 1"


def mjcf_of(content: Content) -> str:
    """The model's text: one body for each link, a motor at each driven joint, no shapes.

    A motor of a transmission pulls a fixed tendon, whose length is the motor's motion behind its gear.

    Joint positions are those of the robot file. Payloads and corrected masses are in the bodies.

    Raises:
        InputError: a link that moves has no mass, with which MuJoCo runs nothing.
    """
    robot = content.robot
    root = ElementTree.Element("mujoco", model=robot.name)
    ElementTree.SubElement(
        root, "compiler", angle="radian", autolimits="true", eulerseq="XYZ", boundinertia=SMALLEST_INERTIA
    )
    ElementTree.SubElement(root, "option", gravity=figures(content.gravity), integrator="implicitfast")
    world = ElementTree.SubElement(root, "worldbody")
    base = ElementTree.SubElement(
        world, "body", name="base", pos=figures(robot.base.position), euler=figures(robot.base.rpy)
    )
    if robot.base.kind == "free":
        ElementTree.SubElement(base, "freejoint", name="base")
        _inertial(base, content.bodies["base"])
    elements = {"base": base}
    for joint in robot.tree:
        body = ElementTree.SubElement(
            elements[joint.parent],
            "body",
            name=joint.child,
            pos=figures(joint.origin),
            euler=figures(joint.rpy),
        )
        elements[joint.child] = body
        _inertial(body, content.bodies[joint.child])
        if joint.kind != "fixed":
            _joint(body, joint, content.joints[joint.name])
    _require_masses(content)
    if robot.transmissions:
        tendons = ElementTree.SubElement(root, "tendon")
        for transmission in robot.transmissions:
            _tendons(tendons, transmission, content)
    motors = [drive for drive in robot.drives if drive.actuator is not None]
    actuators = ElementTree.SubElement(root, "actuator") if motors else root
    for drive in motors:
        own = content.joints if drive.joint else content.motors
        _motor(actuators, drive, own[drive.name])
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _inertial(parent: ElementTree.Element, body: BodyNumbers) -> None:
    """Nothing for a body without mass."""
    if body.mass > 0.0:
        six = [body.inertia[pair] for pair in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        full = any(six[3:])
        ElementTree.SubElement(
            parent,
            "inertial",
            {
                "pos": figures(body.centre),
                "mass": figure(body.mass),
                "fullinertia" if full else "diaginertia": figures(six if full else six[:3]),
            },
        )


def _joint(parent: ElementTree.Element, joint: Joint, numbers: JointNumbers) -> None:
    """The joint; attributes that are zero are left out."""
    element = ElementTree.SubElement(
        parent,
        "joint",
        name=joint.name,
        type="hinge" if joint.kind == "revolute" else "slide",
        axis=figures(joint.unit_axis),
    )
    if joint.position_limits:
        element.set("range", figures(joint.position_limits))
    _passive(element, numbers, rest="springref")


def _passive(element: ElementTree.Element, numbers: JointNumbers, *, rest: str) -> None:
    """Passive forces of a joint or a tendon; `rest` is the attribute of its length without the spring."""
    for key in ("armature", "damping", "frictionloss", "stiffness"):
        if value := getattr(numbers, key):
            element.set(key, figure(value))
    if numbers.frictionloss:
        element.set("solreffriction", STICKING)
    if numbers.stiffness and (numbers.offset or rest == "springlength"):
        element.set(rest, figure(numbers.offset / numbers.stiffness))


def _tendons(parent: ElementTree.Element, transmission: Transmission, content: Content) -> None:
    """One for each motor: its length is a row of C, m = C q."""
    for motor, row in zip(transmission.motors, transmission.motors_from_joints):
        element = ElementTree.SubElement(parent, "fixed", name=motor.name)
        _passive(element, content.motors[motor.name], rest="springlength")
        for joint, part in zip(transmission.joints, row):
            if part:
                ElementTree.SubElement(element, "joint", joint=joint, coef=figure(part))


def _motor(parent: ElementTree.Element, drive: Drive, numbers: JointNumbers) -> None:
    """Force = gain x control + constant offset; that of a spring is in its springref."""
    element = ElementTree.SubElement(
        parent,
        "general",
        {
            "name": drive.name,
            "joint" if drive.joint else "tendon": drive.name,
            "gainprm": figure(numbers.gain),
        },
    )
    if math.isfinite(numbers.limit):
        element.set("ctrlrange", figures((-numbers.limit, numbers.limit)))
    if numbers.offset and not numbers.stiffness:
        element.set("biastype", "affine")
        element.set("biasprm", figures((numbers.offset, 0.0, 0.0)))


def _require_masses(content: Content) -> None:
    """Raises `InputError` where a joint moves nothing that has a mass, nor a rotor."""
    robot = content.robot
    carried = {name: body.mass for name, body in content.bodies.items()}
    for joint in reversed(robot.tree):
        carried[joint.parent] = carried.get(joint.parent, 0.0) + (
            carried[joint.child] if joint.kind == "fixed" else 0.0
        )
        if joint.kind != "fixed" and carried[joint.child] <= 0.0:
            raise InputError(
                f"robot '{robot.name}': link '{joint.child}' moves and has no mass, which MuJoCo refuses; "
                "give it its mass in the robot file, or join it to the next link."
            )
