"""The nominal model of a controller with flexible links or spherical joints.

Every body's motion is written as ``[a; alpha] = J yd + d`` in its own axes, with yd the accelerations of all
coordinates: of a free base, of the joints with one coordinate, of spherical joints (child against parent in
the child's axes), of modal coordinates. With the body's inertia M and its forces f,

    Z = sum J^T M J,    z = sum J^T (f - M d),    Z yd = z + tau.

Coordinates that the controller does not drive react: their part of yd follows from tau = 0 (Kane's method;
Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 3 and 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.flexible_link import FlexibleLink, NodeMotion, flexible_link
from exudyn_model.bodies.mechanism import Mass, undeformed
from exudyn_model.bodies.modal_inertia import ModalInertia
from exudyn_model.bodies.rotation import cross, from_rpy, rotation_by, skew, turning_z_to
from exudyn_model.bodies.transmissions import Transmissions
from exudyn_model.control.rigid_dynamics import BaseState, Inner, Needed
from robot_model import Joint, Robot

__all__ = ["FullDynamics"]

Array = NDArray[np.float64]

#: Coordinates of a base.
SIX = 6


@dataclass(frozen=True)
class _Member:
    """A body and its inboard joint.

    Attributes:
        joint: its description.
        parent: index among the bodies.
        rotation, origin: of the joint in the parent's frame.
        own: rows of the joint's coordinates.
        mass: rigid, the hub of a body that bends.
        bends: its modes; None of a rigid body.
        inertia: of its modes.
        modal: rows of its modal coordinates.
        node: of a bent parent that the joint sits on; None elsewhere.
    """

    joint: Joint
    parent: int
    rotation: Array
    origin: Array
    own: slice
    mass: Mass
    bends: FlexibleLink | None
    inertia: ModalInertia | None
    modal: slice
    node: int | None


@dataclass(frozen=True)
class _Frame:
    """A frame in motion: axes and origin in the inertial frame, angular velocity and [a; alpha] = J yd + d.

    The last three are in the frame's own axes.
    """

    rotation: Array
    origin: Array
    omega: Array
    rows: Array
    drift: Array


@dataclass(frozen=True)
class _Moving:
    """A body in motion: its frame, that of its joint, its inertia, forces, J and d with the modal rows."""

    frame: _Frame
    held: _Frame
    matrix: Array
    force: Array
    rows: Array
    drift: Array


class FullDynamics:
    """Forces required by a motion of the driven coordinates, with all others reacting.

    Args:
        robot: the description that the controller uses.
        deformed: the controller measures link deflection; else it assumes undeformed rigid bodies.
    """

    def __init__(self, robot: Robot, *, deformed: bool) -> None:
        self._robot, self._free = robot, robot.base.kind == "free"
        self.base_rotation = from_rpy(robot.base.rpy)
        self.base_position = np.asarray(robot.base.position, dtype=float)
        self._gravity = np.asarray(robot.gravity, dtype=float)
        self._base_mass = Mass.of(robot.base)
        order = [joint.name for joint in robot.moving_joints]
        balls = [joint.name for joint in robot.spherical_joints]
        #: Names of the links whose bending it knows.
        self.bent_links = tuple(link.name for link in robot.flexible_links) if deformed else ()
        modes = {name: flexible_link(robot.link(name)) for name in self.bent_links}
        self._first = SIX if self._free else 0
        inner = self._first + len(order)
        ends = np.cumsum([inner + 3 * len(balls), *(link.count for link in modes.values())]).tolist()
        modal = {name: slice(a, b) for name, a, b in zip(modes, ends, ends[1:])}
        self._size = ends[-1]
        self._joints = slice(self._first, inner)
        self._balls = [slice(inner + 3 * k, inner + 3 * k + 3) for k in range(len(balls))]
        self._modal = slice(inner + 3 * len(balls), self._size)
        index = {"base": -1}
        self._members: list[_Member] = []
        for joint in robot.tree:
            link, parent = robot.link(joint.child), modes.get(joint.parent)
            own = slice(0, 0)
            if joint.name in order:
                own = slice(self._first + order.index(joint.name), self._first + order.index(joint.name) + 1)
            elif joint.name in balls:
                own = self._balls[balls.index(joint.name)]
            bends = modes.get(link.name)
            origin = np.asarray(joint.origin, dtype=float)
            member = _Member(
                joint,
                index[joint.parent],
                from_rpy(joint.rpy),
                origin,
                own,
                Mass.of(link) if bends else undeformed(link),
                bends,
                ModalInertia(bends) if bends else None,
                modal.get(link.name, slice(0, 0)),
                parent.node_at(origin) if parent and not parent.rigid_frame else None,
            )
            index[link.name] = len(self._members)
            self._members.append(member)
        #: Joint coordinate of every entry of `Needed.joints`.
        self.coordinate = tuple(
            order.index(member.joint.name) for member in self._members if member.joint.name in order
        )
        self._rotors = np.zeros((self._size, self._size))
        self._rotors[self._joints, self._joints] = Transmissions(robot).inertia(robot)
        spins = [joint.initial_angular_velocity for joint in robot.spherical_joints]
        count = self._modal.stop - self._modal.start
        self._start = Inner(
            [np.eye(3)] * len(balls), np.array(spins).ravel(), np.zeros(count), np.zeros(count)
        )

    def __call__(
        self,
        q: Sequence[float],
        qd: Sequence[float],
        qdd: Sequence[float],
        *,
        base: BaseState | None = None,
        inner: Inner | None = None,
    ) -> list[float]:
        """Torques alone; see `needed`."""
        return self.needed(q, qd, qdd, base=base, inner=inner).torques

    def needed(
        self,
        q: Sequence[float],
        qd: Sequence[float],
        qdd: Sequence[float],
        *,
        base: BaseState | None = None,
        held: Array | None = None,
        inner: Inner | None = None,
    ) -> Needed:
        """Forces required by desired accelerations.

        Args:
            q, qd, qdd: of the joints with one coordinate, in the order of the file.
            base: state of a free base; default is the described one.
            held: desired accelerations of a held base, [linear; angular] in base axes, shape (6,); if
                omitted, the base reacts.
            inner: state of spherical joints and flexible links; default is the initial one.
        """
        moving, base_force = self._moving(q, qd, base, inner or self._start)
        mass, forces = self._rotors.copy(), np.zeros(self._size)
        if self._free:
            mass[:SIX, :SIX] += self._base_mass.spatial
            forces[:SIX] += base_force
        for body in moving:
            mass += body.rows.T @ body.matrix @ body.rows
            forces += body.rows.T @ (body.force - body.matrix @ body.drift)
        wanted = np.zeros(self._size)
        wanted[self._joints] = qdd
        passive = list(range(self._joints.stop, self._size))
        if self._free and held is not None:
            wanted[:SIX] = held
        elif self._free:
            passive = [*range(SIX), *passive]
        if passive:
            left = forces[passive] - mass[passive] @ wanted
            wanted[passive] = np.linalg.solve(mass[np.ix_(passive, passive)], left)
        tau = mass @ wanted - forces
        wrench = tau[:SIX].tolist() if self._free else [0.0] * SIX
        return Needed(tau[self._joints].tolist(), wrench, self._joint_forces(moving, wanted))

    def _moving(
        self, q: Sequence[float], qd: Sequence[float], base: BaseState | None, inner: Inner
    ) -> tuple[list[_Moving], Array]:
        """Every body in motion, and the forces on the base."""
        seen = base if base is not None and self._free else BaseState(self.base_rotation, np.zeros(3))
        root = _Frame(
            seen.rotation,
            np.zeros(3),
            seen.angular_velocity,
            np.eye(SIX, self._size) if self._free else np.zeros((SIX, self._size)),
            np.zeros(SIX),
        )
        x, v, rate = np.zeros(self._size), np.zeros(self._size), np.zeros(self._size)
        x[self._joints], rate[self._joints] = q, qd
        x[self._modal], v[self._modal] = inner.modal, inner.modal_rates
        for k, rows in enumerate(self._balls):
            rate[rows] = inner.ball_rates[3 * k : 3 * k + 3]
        turns = {rows.start: turn for rows, turn in zip(self._balls, inner.balls)}
        found: list[_Moving] = []
        for member in self._members:
            frame, origin = root, member.origin
            if member.parent >= 0:
                frame = found[member.parent].frame
            if member.node is not None:
                outer = self._members[member.parent]
                assert outer.bends is not None
                motion = outer.bends.motion(member.node, x[outer.modal], v[outer.modal])
                frame, origin = _to_node(frame, motion, outer.modal), np.zeros(3)
            held = _across(frame, member, origin, x[member.own], rate[member.own], turns)
            frame, bends = held, member.bends
            if bends and bends.moves(bends.root):
                motion = bends.motion(bends.root, x[member.modal], v[member.modal])
                frame = _from_node(held, motion, member.modal)
            found.append(self._body(member, frame, held, x, v))
        return found, _rigid_force(self._base_mass, root, self._gravity)

    def _body(self, member: _Member, frame: _Frame, held: _Frame, x: Array, v: Array) -> _Moving:
        matrix, force = member.mass.spatial, _rigid_force(member.mass, frame, self._gravity)
        if member.inertia is None:
            return _Moving(frame, held, matrix, force, frame.rows, frame.drift)
        own, rates = x[member.modal], v[member.modal]
        whole = member.inertia.mass(own)
        whole[:SIX, :SIX] += matrix
        forces = member.inertia.force(frame.omega, own, rates, frame.rotation.T @ self._gravity)
        forces[:SIX] += force
        count = len(own)
        modal = np.zeros((count, self._size))
        modal[:, member.modal] = np.eye(count)
        rows = np.vstack([frame.rows, modal])
        return _Moving(frame, held, whole, forces, rows, np.concatenate([frame.drift, np.zeros(count)]))

    def _joint_forces(self, moving: Sequence[_Moving], accelerations: Array) -> list[tuple[Array, Array]]:
        """Force on what each joint carries and moment about its origin, in axes whose z is the joint's."""
        wrenches: list[tuple[Array, Array]] = []  # about the base's origin, inertial axes
        for body in moving:
            own = body.matrix @ (body.rows @ accelerations + body.drift) - body.force
            force, moment = body.frame.rotation @ own[:3], body.frame.rotation @ own[3:SIX]
            wrenches.append((force, moment + cross(body.frame.origin, force)))
        for k in range(len(moving) - 1, -1, -1):
            parent = self._members[k].parent
            if parent >= 0:
                mine, outer = wrenches[k], wrenches[parent]
                wrenches[parent] = (outer[0] + mine[0], outer[1] + mine[1])
        found = []
        for member, body, (force, moment) in zip(self._members, moving, wrenches):
            if member.joint.kind in ("revolute", "prismatic"):
                axes = body.held.rotation @ turning_z_to(member.joint.unit_axis)
                about = moment - cross(body.held.origin, force)
                found.append((axes.T @ force, axes.T @ about))
        return found


def _rigid_force(mass: Mass, frame: _Frame, gravity: Array) -> Array:
    """Weight and gyroscopic forces, shape (6,)."""
    omega, moment = frame.omega, mass.first_moment
    along = frame.rotation.T @ gravity
    linear = mass.mass * along - cross(omega, cross(omega, moment))
    return np.concatenate([linear, cross(moment, along) - cross(omega, mass.inertia @ omega)])


def _carried(frame: _Frame, turn: Array, shift: Array, omega: Array, more: tuple[Array, Array]) -> _Frame:
    """A frame turned and shifted against another; `more` are further accelerations in the latter's axes."""
    rows, drift = np.empty_like(frame.rows), np.empty(SIX)
    lever = skew(shift)
    rows[:3], rows[3:] = turn.T @ (frame.rows[:3] - lever @ frame.rows[3:]), turn.T @ frame.rows[3:]
    swing = cross(frame.omega, cross(frame.omega, shift))
    drift[:3] = turn.T @ (frame.drift[:3] - lever @ frame.drift[3:] + swing + more[0])
    drift[3:] = turn.T @ (frame.drift[3:] + more[1])
    return _Frame(frame.rotation @ turn, frame.origin + frame.rotation @ shift, omega, rows, drift)


def _to_node(frame: _Frame, node: NodeMotion, modal: slice) -> _Frame:
    """From the frame of a bent link to the axes of one of its nodes."""
    omega = frame.omega
    more = 2 * cross(omega, node.slides) + node.slide_bias, cross(omega, node.turns) + node.turn_bias
    turned = node.rotation.T @ (omega + node.turns)
    found = _carried(frame, node.rotation, node.place, turned, more)
    found.rows[:3, modal] += node.rotation.T @ node.slide
    found.rows[3:, modal] += node.rotation.T @ node.turn
    return found


def _from_node(held: _Frame, node: NodeMotion, modal: slice) -> _Frame:
    """From the axes of a bent link's node to its frame: `_to_node` backwards."""
    turn, place = node.rotation, node.place
    omega = turn @ held.omega - node.turns
    rows, drift = np.empty_like(held.rows), np.empty(SIX)
    rows[3:] = turn @ held.rows[3:]
    rows[3:, modal] -= node.turn
    drift[3:] = turn @ held.drift[3:] - cross(omega, node.turns) - node.turn_bias
    lever = skew(place)
    rows[:3] = turn @ held.rows[:3] + lever @ rows[3:]
    rows[:3, modal] -= node.slide
    swing = cross(omega, cross(omega, place) + 2 * node.slides)
    drift[:3] = turn @ held.drift[:3] + lever @ drift[3:] - swing - node.slide_bias
    rotation = held.rotation @ turn.T
    return _Frame(rotation, held.origin - rotation @ place, omega, rows, drift)


def _across(
    frame: _Frame, member: _Member, origin: Array, x: Array, rate: Array, turns: dict[int, Array]
) -> _Frame:
    """From the frame that a joint sits on to the one that it carries."""
    kind, axis, turn, shift = member.joint.kind, member.joint.unit_axis, member.rotation, origin
    still = np.zeros(3)
    spin, slide = still, still
    if kind == "revolute":
        turn, spin = turn @ rotation_by(float(x[0]) * axis), float(rate[0]) * axis
    elif kind == "prismatic":
        shift, slide = shift + turn @ axis * float(x[0]), turn @ axis * float(rate[0])
    elif kind == "spherical":
        turn, spin = turn @ turns[member.own.start], rate
    omega = turn.T @ frame.omega + spin
    more = 2 * cross(frame.omega, slide), cross(frame.omega, turn @ spin)
    found = _carried(frame, turn, shift, omega, more)
    if kind == "revolute":
        found.rows[3:, member.own.start] += axis
    elif kind == "prismatic":
        found.rows[:3, member.own.start] += axis
    elif kind == "spherical":
        found.rows[3:, member.own] += np.eye(3)
    return found
