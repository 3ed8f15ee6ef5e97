"""The robot as a tree of moving bodies, each turning about or sliding along its own z axis.

A frame is rotated so that the joint axis becomes z, as Exudyn's tree requires, and links on fixed joints are
welded to the body that carries them. Everything here is constant; nothing depends on the state.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.beam import beam_nodes
from exudyn_model.bodies.flexible_link import rigid_mass
from exudyn_model.bodies.rotation import from_rpy, skew, turning_z_to
from exudyn_model.bodies.transmissions import Transmissions
from robot_model import Link, Robot
from robot_model.description.types import Inertial

__all__ = ["Mass", "Mechanism", "Member", "PointMass", "mechanism_of", "undeformed"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mass:
    """Mass properties about a frame's origin, additive.

    Attributes:
        mass: [kg].
        first_moment: mass times centre of mass [kg m], shape (3,).
        inertia: about the origin [kg m^2], shape (3, 3).
    """

    mass: float = 0.0
    first_moment: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))

    @classmethod
    def of(cls, body: Inertial) -> Mass:
        """From mass, centre of mass and central inertia."""
        c = np.asarray(body.center_of_mass, dtype=float)
        inertia = body.inertia_matrix - body.mass * skew(c) @ skew(c)
        return cls(body.mass, body.mass * c, inertia)

    def __add__(self, other: Mass) -> Mass:
        return Mass(
            self.mass + other.mass, self.first_moment + other.first_moment, self.inertia + other.inertia
        )

    def seen_from(self, rotation: Array, origin: Array) -> Mass:
        """The same body in an outer frame: `rotation` to its axes, `origin` of this frame in it."""
        h = rotation @ self.first_moment
        o, cross = skew(origin), skew(rotation @ self.first_moment)
        inertia = rotation @ self.inertia @ rotation.T - o @ cross - cross @ o - self.mass * o @ o
        return Mass(self.mass, h + self.mass * origin, inertia)

    @property
    def spatial(self) -> Array:
        """[force; moment] per [acceleration of the origin; angular acceleration] at rest, shape (6, 6)."""
        cross = skew(self.first_moment)
        return np.block([[self.mass * np.eye(3), -cross], [cross, self.inertia]])

    @property
    def center(self) -> Array:
        """Centre of mass [m], shape (3,); the origin for a massless body."""
        return self.first_moment / self.mass if self.mass > 0 else np.zeros(3)

    @property
    def central_inertia(self) -> Array:
        """Inertia about the centre of mass [kg m^2], shape (3, 3)."""
        return self.inertia + self.mass * skew(self.center) @ skew(self.center)


@dataclass(frozen=True)
class PointMass:
    """A point that moves with the nearest node of a flexible link.

    Attributes:
        mass: [kg].
        place: in the link's frame, undeformed [m], shape (3,).
    """

    mass: float
    place: Array


@dataclass(frozen=True)
class Member:
    """One moving body and its inboard joint; the joint acts about or along z of the body's frame.

    Attributes:
        joint, link: names.
        parent: index of the inboard member, -1 for the base.
        revolute: turns about z; otherwise slides along z.
        rotation: this frame's axes in the parent's at zero position, shape (3, 3).
        origin: this frame's origin in the parent's at zero position [m], shape (3,).
        body: mass properties in this frame, welded links included.
        rotor: inertia of rotors on the joint, gear ratio squared times it [kg m^2 or kg].
    """

    joint: str
    link: str
    parent: int
    revolute: bool
    rotation: Array
    origin: Array
    body: Mass
    rotor: float


@dataclass(frozen=True)
class Mechanism:
    """A tree of members; member k owns joint coordinate `coordinate[k]` of `robot.moving_joints`.

    Attributes:
        members: each after its parent.
        base: mass properties of the base, links welded to it included.
        gravity: inertial frame [m/s^2], shape (3,).
        free: the base floats.
        base_rotation, base_position: of the base in the inertial frame at the start.
        coordinate: from member to index in joint-space vectors.
        coupled: off-diagonal part of the rotors' mass matrix on the joints, where motors move several
            joints, shape (n, n) [kg m^2, kg m or kg]; None without any.
    """

    members: tuple[Member, ...]
    base: Mass
    gravity: Array
    free: bool
    base_rotation: Array
    base_position: Array
    coordinate: tuple[int, ...]
    coupled: Array | None = None


def mechanism_of(
    robot: Robot,
    *,
    added: Mapping[str, Mass] | None = None,
    added_gravity: Array | None = None,
    apart: Collection[int] = (),
) -> Mechanism:
    """The mechanism of `robot`, flexible links undeformed, with additions to bodies and to gravity.

    Args:
        robot: the description.
        added: body name (a link or `base`) to mass properties added in that body's own frame.
        added_gravity: inertial frame [m/s^2], shape (3,).
        apart: indices of the drives with a separate rotor coordinate, not part of the mechanism.
    """
    added = added or {}
    rotors = Transmissions(robot).inertia(robot, apart)
    order = [joint.name for joint in robot.moving_joints]
    # Where each body of the description sits: carrying member, and its frame within the member's frame.
    place: dict[str, tuple[int, Array, Array]] = {"base": (-1, np.eye(3), np.zeros(3))}
    masses = {-1: Mass.of(robot.base) + added.get("base", Mass())}
    drafts: list[Member] = []
    for joint in robot.tree:
        carrier, turn, offset = place[joint.parent]
        rotation, origin = turn @ from_rpy(joint.rpy), offset + turn @ np.asarray(joint.origin, dtype=float)
        if joint.kind == "fixed":
            place[joint.child] = (carrier, rotation, origin)
        else:
            align = turning_z_to(joint.unit_axis)
            drafts.append(_draft(robot, joint.name, parent=carrier, rotation=rotation @ align, origin=origin))
            place[joint.child] = (len(drafts) - 1, align.T, np.zeros(3))
        index, inner, shift = place[joint.child]
        body = undeformed(robot.link(joint.child)) + added.get(joint.child, Mass())
        masses[index] = masses.get(index, Mass()) + body.seen_from(inner, shift)
    members = tuple(replace(draft, body=masses[k]) for k, draft in enumerate(drafts))
    felt = dict(zip(order, np.diag(rotors).tolist()))
    members = tuple(replace(member, rotor=felt[member.joint]) for member in members)
    beside = rotors - np.diag(np.diag(rotors))
    return Mechanism(
        members=members,
        base=masses[-1],
        gravity=np.asarray(robot.gravity, dtype=float) + (0.0 if added_gravity is None else added_gravity),
        free=robot.base.kind == "free",
        base_rotation=from_rpy(robot.base.rpy),
        base_position=np.asarray(robot.base.position, dtype=float),
        coordinate=tuple(order.index(member.joint) for member in members),
        coupled=beside if beside.any() else None,
    )


def undeformed(link: Link) -> Mass:
    """A link with its beam and tip, its imported body, or its mass on springs, rigid."""
    whole = Mass.of(link)
    for node in beam_nodes(link.beam) if link.beam else ():
        cross = skew(node.position)
        inertia = node.inertia - node.mass * cross @ cross
        whole += Mass(node.mass, node.mass * node.position, inertia)
    if link.modal:
        whole += Mass(*rigid_mass(link))
    return whole + Mass(link.sprung.mass) if link.sprung else whole


def _draft(robot: Robot, name: str, *, parent: int, rotation: Array, origin: Array) -> Member:
    joint = robot.joint(name)
    return Member(name, joint.child, parent, joint.kind == "revolute", rotation, origin, Mass(), 0.0)
