"""Consistency checks of a robot; each raises `ValueError` with key, value and remedy.

Called once, when a `Robot` is made: all other code trusts the description.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from robot_model.description.mobility import idle_coordinate
from robot_model.description.transmission import check_transmissions
from robot_model.input.errors import nearest

if TYPE_CHECKING:
    from robot_model.description.types import Joint, Robot

__all__ = ["check_robot", "in_tree_order"]

#: Keys of a controller that hold one number for all moving joints or one for each.
GAIN_KEYS = (
    *("kp", "kd", "ki", "gain", "coulomb_feedforward", "load_feedforward"),
    *("slope", "rate", "proportional", "boundary_layer"),
)

#: Tolerated distance of a joint from a node of the beam that carries it, relative to the beam's length.
NODE_TOLERANCE = 1e-6


def check_robot(robot: Robot) -> None:
    """All checks, ordered so that the first failure is the most informative."""
    _names_are_unique(robot)
    _bodies_exist(robot)
    _is_a_tree(robot)
    check_transmissions(robot)
    _reference_fits(robot)
    _gains_fit(robot)
    _centres_fit(robot)
    _joints_sit_on_nodes(robot)
    _base_hold_fits(robot)
    _feedforward_fits(robot)
    _sensors_fit(robot)
    _known_exists(robot)
    _moves_inertia(robot)


def in_tree_order(joints: Iterable[Joint]) -> tuple[Joint, ...]:
    """The joints connected to the base, each after the one that carries its parent; else in file order."""
    waiting: dict[str, list[tuple[int, Joint]]] = {}
    for index, joint in enumerate(joints):
        waiting.setdefault(joint.parent, []).append((index, joint))
    order: list[Joint] = []
    level = waiting.pop("base", [])
    while level:
        order += [joint for _, joint in level]
        level = sorted((pair for _, joint in level for pair in waiting.pop(joint.child, [])), key=_index)
    return tuple(order)


def _index(pair: tuple[int, Joint]) -> int:
    return pair[0]


def _repeated(words: Iterable[str]) -> str | None:
    return next((word for word, count in Counter(words).items() if count > 1), None)


def _names_are_unique(robot: Robot) -> None:
    bodies = ["base", *(link.name for link in robot.links)]
    joints = [joint.name for joint in robot.joints]
    for key, names in (("links", bodies), ("joints", joints)):
        if twice := _repeated(names):
            raise ValueError(f"{key}: the name '{twice}' is used twice; names must be unique")
    if clash := _repeated([*bodies, *joints]):
        raise ValueError(f"joints: the name '{clash}' is both a body's and a joint's; names must be unique")


def _bodies_exist(robot: Robot) -> None:
    bodies = ["base", *(link.name for link in robot.links)]
    for joint in robot.joints:
        for role, body in (("parent", joint.parent), ("child", joint.child)):
            if body not in bodies:
                raise ValueError(f"joints[{joint.name}].{role}: '{body}' is no body{nearest(body, bodies)}")
        if joint.child == "base":
            raise ValueError(f"joints[{joint.name}].child: the base cannot be a child; swap the two bodies")


def _is_a_tree(robot: Robot) -> None:
    carried = Counter(joint.child for joint in robot.joints)
    for link in robot.links:
        if carried[link.name] == 0:
            raise ValueError(f"links[{link.name}]: no joint has it as its child, so that it hangs on nothing")
        if carried[link.name] > 1:
            raise ValueError(
                f"links[{link.name}]: {carried[link.name]} joints have it as their child; one may, since the "
                "bodies must form a tree"
            )
    reached = {joint.name for joint in in_tree_order(robot.joints)}
    cycle = [joint.name for joint in robot.joints if joint.name not in reached]
    if cycle:
        raise ValueError(
            f"joints: the chain of {', '.join(cycle[:4])} runs in a cycle and never reaches the base"
        )


def _reference_fits(robot: Robot) -> None:
    moving = [joint.name for joint in robot.moving_joints]
    named = [motion.joint for motion in robot.reference.joints] if robot.reference else []
    for name in named:
        if name not in moving:
            raise ValueError(f"reference.joints: '{name}' is no moving joint{nearest(name, moving)}")
    if twice := _repeated(named):
        raise ValueError(f"reference.joints: '{twice}' has two motions; one may be given")


def _gains_fit(robot: Robot) -> None:
    count = len(robot.moving_joints)
    for key in GAIN_KEYS:
        gains = getattr(robot.controller, key, None)
        if isinstance(gains, tuple) and len(gains) != count:
            raise ValueError(
                f"controller.{key}: has {len(gains)} entries but needs {count}, one for each moving joint; a "
                "single number without brackets is for all of them"
            )


def _centres_fit(robot: Robot) -> None:
    """A network's centres lie on the reference, which has no more distinct points than samples."""
    centres = getattr(robot.controller, "centres", None)
    if centres is None:
        return
    if robot.reference is None:
        raise ValueError("controller.centres: they sit on the reference motion; add a [reference] table")
    samples = int(robot.reference.duration * robot.reference.sample_rate * (1 + 1e-12)) + 1
    if centres > samples:
        raise ValueError(
            f"controller.centres: {centres} centres are more than the {samples} samples of the reference; "
            f"take {samples} or fewer"
        )


def _joints_sit_on_nodes(robot: Robot) -> None:
    """A flexible beam deforms at its nodes; a joint on it must sit at one."""
    beams = {link.name: link.beam for link in robot.links if link.beam}
    for joint in robot.joints:
        beam = beams.get(joint.parent)
        if beam is None:
            continue
        gaps = np.linalg.norm(beam.nodes - np.asarray(joint.origin), axis=1)
        if gaps.min() > NODE_TOLERANCE * beam.length:
            near = [round(float(x), 9) for x in beam.nodes[int(gaps.argmin())]]
            raise ValueError(
                f"joints[{joint.name}].origin: {list(joint.origin)} is no node of the beam "
                f"'{joint.parent}'; the nearest node is at {near}, or choose other elements"
            )


def _base_hold_fits(robot: Robot) -> None:
    if getattr(robot.controller, "base_kp", None) is not None and robot.base.kind != "free":
        raise ValueError("controller.base_kp: the base is fixed and needs no holding; remove the key")


def _feedforward_fits(robot: Robot) -> None:
    """Without a bearing, friction in proportion to the load would silently be zero."""
    share = getattr(robot.controller, "load_feedforward", 0.0)
    joints = robot.moving_joints
    shares = share if isinstance(share, tuple) else (share,) * len(joints)
    bare = [joint.name for joint, value in zip(joints, shares) if value and joint.bearing is None]
    if bare:
        raise ValueError(
            f"controller.load_feedforward: joint '{bare[0]}' has no bearing, so that its load makes no "
            "friction; give the joint a bearing, or a list of coefficients with 0 for it"
        )


def _part_names(robot: Robot) -> list[str]:
    motors = (motor.name for motor in robot.motors)
    return [*(joint.name for joint in robot.joints), *motors, *(link.name for link in robot.links)]


def _sensors_fit(robot: Robot) -> None:
    places = ["base", *_part_names(robot)]
    channels = [sensor.channel for sensor in robot.sensors]
    for channel in channels:
        place = channel.split(".")[0]
        if place not in places:
            raise ValueError(
                f"sensors[{channel}].channel: '{place}' is no joint, motor, link or base"
                f"{nearest(place, places)}"
            )
    for channel in channels:
        _gauge_exists(robot, channel)
    if twice := _repeated(channels):
        raise ValueError(f"sensors: the channel '{twice}' is described twice; keep one")


def _gauge_exists(robot: Robot, channel: str) -> None:
    """A beam's gauges are numbered from 1; gauges of other links are not known here."""
    place, quantity, *rest = channel.split(".")
    beam = next((link.beam for link in robot.links if link.name == place), None)
    numbers = [str(number + 1) for number in range(len(beam.gauges))] if beam else []
    if beam and quantity == "strain" and rest[:1] not in [[number] for number in numbers]:
        raise ValueError(
            f"sensors[{channel}].channel: the gauges of '{place}' are {', '.join(numbers) or 'none'}; add "
            "one to the beam's gauges, or correct the number"
        )


def _known_exists(robot: Robot) -> None:
    places = ["base", "gravity", *_part_names(robot)]
    for entry in robot.known:
        place = entry.split(".")[0]
        if place not in places:
            raise ValueError(
                f"known: '{entry}' begins with no joint, motor, link or base{nearest(place, places)}"
            )


def _moves_inertia(robot: Robot) -> None:
    """A massless link is allowed between others; a coordinate that moves no inertia is not."""
    massless = {link.name for link in robot.links if link.mass == 0 and not link.flexible}
    if any(use.at in massless for use in robot.effects):
        return  # an effect such as a payload adds mass, which is not known here
    idle = idle_coordinate(robot)
    if idle == "base":
        raise ValueError("base.inertia: the free base turns without any inertia; give its moments of inertia")
    if idle:
        raise ValueError(
            f"joints[{idle}]: it moves nothing that has inertia, so that its motion is undefined; give link "
            f"'{robot.joint(idle).child}' a mass off the axis or an inertia, or the actuator a rotor_inertia"
        )
