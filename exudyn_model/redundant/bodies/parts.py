"""The robot as separate bodies and the connections between them: data of the redundant formulation.

Rigid links on fixed joints are welded to the rigid body that carries them. A flexible link is always a
separate body, and so is every link attached to its deforming nodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.flexible_link import FlexibleLink, NodeMotion, flexible_link
from exudyn_model.bodies.mechanism import Mass, PointMass
from exudyn_model.bodies.rotation import from_rpy, rotation_by, turning_z_to
from robot_model import Joint, Link, Robot

__all__ = ["Bending", "Connection", "Part", "Pose", "at_node", "initial_poses", "parts_of"]

Array = NDArray[np.float64]

#: Modal coordinates of a link and their rates, shape (s,) each.
Bending = tuple[Array, Array]


@dataclass(frozen=True)
class Part:
    """One body; its frame is that of the link, or of the base, that gives its name.

    Attributes:
        name: `base` or a link.
        mass: of the rigid body with what is welded to it; of the rigid hub when it is flexible.
        link: the description of a flexible link, None of a rigid body.
        points: masses on the nodes of a flexible link.
        flexible: the modes of a flexible link.
    """

    name: str
    mass: Mass
    link: Link | None = None
    points: tuple[PointMass, ...] = ()
    flexible: FlexibleLink | None = None


@dataclass(frozen=True)
class Connection:
    """A joint between two parts.

    Attributes:
        joint: its description.
        parent, child: indices of the parts.
        rotation, origin: of the joint frame in the parent's frame, shapes (3, 3) and (3,).
        align: rotates the joint frame so that the joint axis becomes z, shape (3, 3).
    """

    joint: Joint
    parent: int
    child: int
    rotation: Array
    origin: Array
    align: Array


@dataclass(frozen=True)
class Pose:
    """A frame's attitude and motion in the inertial frame.

    Attributes:
        rotation: frame to inertial axes, shape (3, 3).
        position, velocity: of its origin, inertial axes [m, m/s], shape (3,).
        omega: angular velocity in its own axes [rad/s], shape (3,).
    """

    rotation: Array
    position: Array
    velocity: Array
    omega: Array


def parts_of(
    robot: Robot,
    added: Mapping[str, Mass],
    points: Mapping[str, tuple[PointMass, ...]],
    stiffening: Mapping[str, float] | None = None,
) -> tuple[tuple[Part, ...], tuple[Connection, ...]]:
    """Bodies, each after the one that carries it, the base first; and their connections, in that order.

    `added` is fixed in the frames of bodies, `points` on the nodes of flexible links, both by name;
    `stiffening` is the fraction of stiffening of each beam, 1 by default.
    """
    parts = [Part("base", Mass.of(robot.base) + added.get("base", Mass()))]
    shares = stiffening or {}
    connections: list[Connection] = []
    place: dict[str, tuple[int, Array, Array]] = {"base": (0, np.eye(3), np.zeros(3))}
    for joint in robot.tree:
        carrier, turn, offset = place[joint.parent]
        rotation, origin = turn @ from_rpy(joint.rpy), offset + turn @ np.asarray(joint.origin, dtype=float)
        link = robot.link(joint.child)
        mass = Mass.of(link) + added.get(link.name, Mass())
        if joint.kind == "fixed" and parts[carrier].link is None and not link.flexible:
            place[link.name] = (carrier, rotation, origin)
            whole = parts[carrier].mass + mass.seen_from(rotation, origin)
            parts[carrier] = replace(parts[carrier], mass=whole)
            continue
        align = np.eye(3) if joint.kind in ("fixed", "spherical") else turning_z_to(joint.unit_axis)
        connections.append(Connection(joint, carrier, len(parts), rotation, origin, align))
        place[link.name] = (len(parts), np.eye(3), np.zeros(3))
        part = Part(link.name, mass)
        if link.flexible:
            modes = flexible_link(link, shares.get(link.name, 1.0))
            part = replace(part, link=link, points=points.get(link.name, ()), flexible=modes)
        parts.append(part)
    return tuple(parts), tuple(connections)


def initial_poses(
    robot: Robot,
    parts: Sequence[Part],
    connections: Sequence[Connection],
    *,
    base: Pose | None = None,
    bent: Mapping[str, Bending] | None = None,
) -> list[Pose]:
    """Frames of all parts at time 0, with the joints' initial positions and velocities.

    `base` is the pose and velocity of the base, by default at rest in the nominal pose. `bent` is
    the deflection of flexible links by name; others are straight.
    """
    still = np.zeros(3)
    resting = Pose(from_rpy(robot.base.rpy), np.asarray(robot.base.position, dtype=float), still, still)
    poses = [base or resting]
    for link in connections:
        outer, inner = parts[link.parent], parts[link.child]
        pose = poses[link.parent]
        if outer.flexible and not outer.flexible.rigid_frame:
            node = outer.flexible.node_at(link.origin)
            pose = at_node(pose, outer.flexible.motion(node, *_bending(outer, bent)))
            link = replace(link, origin=still)
        pose = _carried(pose, link)
        if inner.flexible and inner.flexible.moves(inner.flexible.root):
            pose = _from_node(pose, inner.flexible.motion(inner.flexible.root, *_bending(inner, bent)))
        poses.append(pose)
    return poses


def _bending(part: Part, bent: Mapping[str, Bending] | None) -> Bending:
    assert part.flexible is not None
    still = np.zeros(part.flexible.count)
    return (bent or {}).get(part.name, (still, still))


def at_node(frame: Pose, node: NodeMotion) -> Pose:
    """Pose of a node of a bent link, from the pose of its frame."""
    return Pose(
        frame.rotation @ node.rotation,
        frame.position + frame.rotation @ node.place,
        frame.velocity + frame.rotation @ (np.cross(frame.omega, node.place) + node.slides),
        node.rotation.T @ (frame.omega + node.turns),
    )


def _from_node(held: Pose, node: NodeMotion) -> Pose:
    """Pose of the frame of a bent link, from the pose of its node: inverse of `at_node`."""
    rotation = held.rotation @ node.rotation.T
    omega = node.rotation @ held.omega - node.turns
    return Pose(
        rotation,
        held.position - rotation @ node.place,
        held.velocity - rotation @ (np.cross(omega, node.place) + node.slides),
        omega,
    )


def _carried(outer: Pose, link: Connection) -> Pose:
    joint = link.joint
    axis, turn, slide = joint.unit_axis, np.eye(3), np.zeros(3)
    rate, speed = np.zeros(3), np.zeros(3)
    if joint.kind == "revolute":
        turn, rate = rotation_by(joint.initial_position * axis), joint.initial_velocity * axis
    elif joint.kind == "prismatic":
        slide, speed = joint.initial_position * axis, joint.initial_velocity * axis
    elif joint.kind == "spherical":
        rate = np.asarray(joint.initial_angular_velocity, dtype=float)
    lever = link.origin + link.rotation @ slide
    inward = link.rotation @ turn
    return Pose(
        outer.rotation @ inward,
        outer.position + outer.rotation @ lever,
        outer.velocity + outer.rotation @ (np.cross(outer.omega, lever) + link.rotation @ speed),
        inward.T @ outer.omega + rate,
    )
