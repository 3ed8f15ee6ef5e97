"""The kinematic tree of a robot, and the velocity recursion from the base to the tips.

The single-direction recursion of Liu, Li, Wang, Cai, Aerospace Science and Technology 47 (2015) 164-176:
every body's velocity column follows from its inboard body's and its own hinge coordinates alone,
``v_i = T_ij v_j + U_i yd_i`` and ``vd_i = T_ij vd_j + U_i ydd_i + beta_i``. Velocity columns are
``v_i = [rd_i; omega_i; xd_i]``, the inertial velocity of the frame's origin [m/s] and the angular velocity
[rad/s], both in the body's own axes, and the rates of the body's s modal coordinates; those of a rigid body
have six rows. A body's own coordinates are those of its inboard joint, then its modal coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.dynamics.joints import joint_step, node_of, node_step, root_step
from reference_model.flexible import FlexibleBody, flexible_body
from reference_model.flexible.beam_numbers import BeamNumber, beam_numbers
from reference_model.kinematics.spatial import rotation_from_quaternion, rotation_from_rpy, rows_of
from robot_model import Link, Robot

__all__ = ["Body", "BodyState", "State", "Tree", "across", "flexible_bodies", "recursion", "tree_of"]


@dataclass(frozen=True, eq=False)
class Body:
    """One body with its inboard joint, as constants.

    Attributes:
        name: of the link, or `base`.
        parent: index of the inboard body in `Tree.bodies`; -1 for the base.
        kind: of the inboard joint; the base counts as fixed to its own frame.
        coordinate: place of the joint's coordinate in joint-space vectors; -1 where there is none.
        rotation: joint frame to parent frame at zero position, 3 x 3.
        origin: of the joint frame in the parent's frame [m], shape (3,).
        axis: unit joint axis in the joint's (and the body's) axes, shape (3,).
        ball: which of the spherical joints the inboard joint is; -1 where it is none.
        flexible: constants of a deformable body, without its rigid hub.
        modal: first of its modal coordinates among all.
        node: node of a flexible parent on which the joint sits; -1 on a rigid parent.
        numbers: parameters of a beam, which are among the inertial ones.
    """

    name: str
    parent: int = -1
    kind: Literal["revolute", "prismatic", "spherical", "fixed"] = "fixed"
    coordinate: int = -1
    rotation: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    axis: NDArray[np.float64] = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    ball: int = -1
    flexible: FlexibleBody | None = None
    modal: int = 0
    node: int = -1
    numbers: tuple[BeamNumber, ...] = ()

    @property
    def modes(self) -> int:
        """Number of modal coordinates."""
        return self.flexible.count if self.flexible else 0


@dataclass(frozen=True)
class Tree:
    """Bodies in an order in which each follows its inboard body; index 0 is the base.

    Generalised vectors hold the base's six rows (of a free base), then the one-coordinate joints in file
    order, then three of each spherical joint, then the modal coordinates of all flexible links. The last
    two are the inner coordinates.

    Attributes:
        bodies: base first.
        joints: names of the one-coordinate joints in the order of the robot file.
        free_base: the base has six coordinates of its own.
        balls: names of the spherical joints.
        modal: number of modal coordinates of all bodies.
    """

    bodies: tuple[Body, ...]
    joints: tuple[str, ...]
    free_base: bool
    balls: tuple[str, ...] = ()
    modal: int = 0

    @property
    def moved(self) -> tuple[int, ...]:
        """Index of the outboard body of each one-coordinate joint, in the order of `joints`."""
        places = {body.coordinate: index for index, body in enumerate(self.bodies)}
        return tuple(places[k] for k in range(len(self.joints)))

    @property
    def offset(self) -> int:
        """Rows of the base in generalised vectors."""
        return 6 if self.free_base else 0

    @property
    def beam_names(self) -> tuple[str, ...]:
        """Names of beam parameters among the inertial ones, `LINK.NUMBER`."""
        return tuple(f"{body.name}.{number.name}" for body in self.bodies for number in body.numbers)

    @property
    def beam_values(self) -> tuple[float, ...]:
        """Their values in the description."""
        return tuple(number.value for body in self.bodies for number in body.numbers)

    @property
    def inner(self) -> int:
        """Number of rates of spherical joints and modal coordinates."""
        return 3 * len(self.balls) + self.modal

    @property
    def rows(self) -> int:
        """Number of generalised coordinates, base first."""
        return self.offset + len(self.joints) + self.inner

    def elasticity(self, beams: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Stiffness and damping of the modal coordinates for these beam parameters, shape (s, s) each."""
        stiffness, damping = np.zeros((2, self.modal, self.modal))
        at = 0
        for body in self.bodies:
            if body.flexible is None:
                continue
            own = slice(body.modal, body.modal + body.modes)
            stiffness[own, own], damping[own, own] = body.flexible.stiffness, body.flexible.damping
            for number in body.numbers:
                more = beams[at] - number.value
                stiffness[own, own] += more * number.change.stiffness
                damping[own, own] += more * number.change.damping
                at += 1
        return stiffness, damping

    def index(self, name: str) -> int:
        """Index of the body of that name."""
        return next(index for index, body in enumerate(self.bodies) if body.name == name)

    def own(self, index: int) -> list[int]:
        """Rows of one body's own coordinates: its joint's, then its modal ones."""
        if index == 0:
            return list(range(self.offset))
        body, inner = self.bodies[index], self.offset + len(self.joints)
        rows = [self.offset + body.coordinate] if body.coordinate >= 0 else []
        rows += [inner + 3 * body.ball + axis for axis in range(3)] if body.ball >= 0 else []
        first = inner + 3 * len(self.balls) + body.modal
        return [*rows, *range(first, first + body.modes)]


@dataclass(frozen=True)
class State:
    """Position and velocity of the robot, as expressions.

    Attributes:
        position, velocity: of the one-coordinate joints [rad or m, rad/s or m/s], n x 1.
        attitude: quaternion of the base, 4 x 1.
        base_velocity: [rd_0; omega_0] in base axes [m/s, rad/s], 6 x 1.
        base_position: origin of the base frame in the inertial frame [m], 3 x 1.
        balls: quaternions of the spherical joints, child to joint axes, 4 k x 1.
        ball_rates: angular velocities of child against parent, child axes [rad/s], 3 k x 1.
        modal, modal_rates: of all flexible links [sqrt(kg) m], s x 1.
    """

    position: ca.SX
    velocity: ca.SX
    attitude: ca.SX
    base_velocity: ca.SX
    base_position: ca.SX
    balls: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    ball_rates: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    modal: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    modal_rates: ca.SX = field(default_factory=lambda: ca.SX(0, 1))

    def deformation(self, body: Body) -> tuple[ca.SX, ca.SX]:
        """Modal coordinates and rates of one body, s_i x 1 each."""
        own = range(body.modal, body.modal + body.modes)
        return rows_of(self.modal, own), rows_of(self.modal_rates, own)

    def joint(self, body: Body) -> tuple[ca.SX, ca.SX]:
        """Position and rate of a body's inboard joint; empty for a fixed one."""
        if body.coordinate >= 0:
            return self.position[body.coordinate], self.velocity[body.coordinate]
        if body.ball >= 0:
            k = body.ball
            return self.balls[4 * k : 4 * k + 4], self.ball_rates[3 * k : 3 * k + 3]
        return ca.SX(0, 1), ca.SX(0, 1)


@dataclass(frozen=True)
class BodyState:
    """One body's part of the recursion, in its own axes unless said otherwise.

    Attributes:
        transfer: T_ij, from the inboard body's velocity column to this one's, (6 + s_i) x (6 + s_j); empty
            for the base.
        hinge: U_i, columns of this body's own coordinates, (6 + s_i) x (number of them).
        bias: beta_i [m/s^2, rad/s^2], (6 + s_i) x 1.
        velocity: v_i, (6 + s_i) x 1.
        rotation: A_i, body to inertial axes, 3 x 3.
        position: r_i, origin in the inertial frame [m], 3 x 1.
        bearing: from the joint's carried frame (its own axes) to the body's frame, 6 x 6; identity unless
            the body has free modes.
        modal: x_i, s_i x 1.
    """

    transfer: ca.SX
    hinge: ca.SX
    bias: ca.SX
    velocity: ca.SX
    rotation: ca.SX
    position: ca.SX
    bearing: ca.SX
    modal: ca.SX


def flexible_bodies(robot: Robot) -> dict[str, FlexibleBody]:
    """The constants of every flexible link without its hub, by name, in file order."""
    return {link.name: flexible_body(link).without_hub(link) for link in robot.flexible_links}


def tree_of(robot: Robot, bodies: Mapping[str, FlexibleBody] | None = None, *, beams: bool = False) -> Tree:
    """The constants of the recursion, from a checked description.

    Args:
        robot: the description.
        bodies: replaces the constants of its flexible links, by name, in file order.
        beams: whether beam parameters are among the inertial ones.

    Raises:
        InputError: a flexible link has no usable modes, or a joint sits at none of its nodes.
    """
    joints = tuple(joint.name for joint in robot.moving_joints)
    balls = tuple(joint.name for joint in robot.spherical_joints)
    flexible = dict(flexible_bodies(robot) if bodies is None else bodies)
    first = dict(zip(flexible, np.cumsum([0, *(body.count for body in flexible.values())]).tolist()))
    members = [Body("base")]
    index = {"base": 0}
    for joint in robot.tree:
        index[joint.child] = len(members)
        inboard = flexible.get(joint.parent)
        members.append(
            Body(
                name=joint.child,
                parent=index[joint.parent],
                kind=joint.kind,
                coordinate=joints.index(joint.name) if joint.name in joints else -1,
                rotation=rotation_from_rpy(joint.rpy),
                origin=np.asarray(joint.origin, dtype=float),
                axis=joint.unit_axis,
                ball=balls.index(joint.name) if joint.name in balls else -1,
                flexible=flexible.get(joint.child),
                modal=first.get(joint.child, 0),
                node=inboard.node_at(joint.origin) if inboard else -1,
                numbers=_numbers(robot.link(joint.child), flexible.get(joint.child)) if beams else (),
            )
        )
    modal = sum(body.count for body in flexible.values())
    return Tree(tuple(members), joints, robot.base.kind == "free", balls, modal)


def _numbers(link: Link, body: FlexibleBody | None) -> tuple[BeamNumber, ...]:
    return () if link.beam is None or body is None else beam_numbers(link.beam, body)


def recursion(tree: Tree, state: State) -> tuple[BodyState, ...]:
    """Every body's transfer, hinge columns, bias and velocity, from the base outwards."""
    states = [_base(tree, state)]
    for body in tree.bodies[1:]:
        states.append(across(tree, body, states[body.parent], state))
    return tuple(states)


def _base(tree: Tree, state: State) -> BodyState:
    """v_0 = U_0 yd_0 with U_0 = 1 and beta_0 = 0; a fixed base has no columns."""
    return BodyState(
        transfer=ca.SX(6, 0),
        hinge=ca.SX.eye(6) if tree.free_base else ca.SX(6, 0),
        bias=ca.SX(6, 1),
        velocity=state.base_velocity,
        rotation=rotation_from_quaternion(state.attitude),
        position=state.base_position,
        bearing=ca.SX.eye(6),
        modal=ca.SX(0, 1),
    )


def across(tree: Tree, body: Body, inboard: BodyState, state: State) -> BodyState:
    """One step of the recursion across the inboard joint of `body`."""
    parent = tree.bodies[body.parent]
    transfer, bias, velocity = _identity(6, parent.modes), ca.SX(6, 1), inboard.velocity[:6]
    turn, shift = ca.SX.eye(3), ca.SX(3, 1)
    origin = body.origin
    if parent.flexible:
        x, rate = state.deformation(parent)
        step = node_step(node_of(parent.flexible, body.node, x, rate), velocity, rate)
        transfer, bias, velocity = ca.horzcat(step.transfer, step.columns), step.bias, step.velocity
        turn, shift, origin = step.rotation, step.shift, np.zeros(3)
    place, rate = state.joint(body)
    step = joint_step(body.kind, body.rotation, origin, body.axis, place=place, rate=rate, velocity=velocity)
    transfer, bias, velocity = step.transfer @ transfer, step.transfer @ bias + step.bias, step.velocity
    shift, turn = shift + turn @ step.shift, turn @ step.rotation
    hinge, bearing = step.columns, ca.SX.eye(6)
    x, rate = state.deformation(body)
    if body.flexible and _root_moves(body.flexible):
        step = root_step(node_of(body.flexible, body.flexible.root, x, rate), velocity, rate)
        transfer, bias, velocity = step.transfer @ transfer, step.transfer @ bias + step.bias, step.velocity
        shift, turn = shift + turn @ step.shift, turn @ step.rotation
        hinge, bearing = ca.horzcat(step.transfer @ hinge, step.columns), step.transfer
    elif body.flexible:
        hinge = ca.horzcat(hinge, ca.SX(6, body.modes))
    s = body.modes
    own = hinge.shape[1] - s
    return BodyState(
        transfer=ca.vertcat(transfer, ca.SX(s, transfer.shape[1])),
        hinge=ca.vertcat(hinge, ca.horzcat(ca.SX(s, own), ca.SX.eye(s))),
        bias=ca.vertcat(bias, ca.SX(s, 1)),
        velocity=ca.vertcat(velocity, rate),
        rotation=inboard.rotation @ turn,
        position=inboard.position + inboard.rotation @ shift,
        bearing=bearing,
        modal=x,
    )


def _identity(rows: int, more: int) -> ca.SX:
    return ca.horzcat(ca.SX.eye(rows), ca.SX(rows, more))


def _root_moves(body: FlexibleBody) -> bool:
    """Whether the root moves in the body's frame: not with clamped modes."""
    return bool(np.any(body.translations[body.root]) or np.any(body.rotations[body.root]))
