"""The kinematic tree of a robot, and the velocity recursion from the base to the tips.

The single-direction recursion of Liu, Li, Wang, Cai, Aerospace Science and Technology 47 (2015) 164-176:
every body's velocity column follows from its inboard body's and its own hinge coordinates alone,
``v_i = T_ij v_j + U_i yd_i`` and ``vd_i = T_ij vd_j + U_i ydd_i + beta_i``. Velocity columns are
``v_i = [rd_i; omega_i]``, the inertial velocity of the frame's origin [m/s] and the angular velocity [rad/s],
both in the body's own axes; a body with s modal coordinates appends their s rates, T_ij and U_i gain the
modal columns of the nodes of attachment, and nothing else in the recursion changes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.spatial import rotation_about, rotation_from_quaternion, rotation_from_rpy, skew
from robot_model import Robot

__all__ = ["Body", "BodyState", "State", "Tree", "recursion", "tree_of"]


@dataclass(frozen=True)
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
    """

    name: str
    parent: int = -1
    kind: Literal["revolute", "prismatic", "spherical", "fixed"] = "fixed"
    coordinate: int = -1
    rotation: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    axis: NDArray[np.float64] = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class Tree:
    """Bodies in an order in which each follows its inboard body; index 0 is the base.

    Attributes:
        bodies: base first.
        joints: names of the moving joints in the order of the robot file.
        free_base: the base has six coordinates of its own.
        moved: index of the outboard body of each moving joint, in the order of `joints`.
    """

    bodies: tuple[Body, ...]
    joints: tuple[str, ...]
    free_base: bool

    @property
    def moved(self) -> tuple[int, ...]:
        places = {body.coordinate: index for index, body in enumerate(self.bodies)}
        return tuple(places[k] for k in range(len(self.joints)))

    @property
    def rows(self) -> int:
        """Number of generalised coordinates, base first."""
        return len(self.joints) + (6 if self.free_base else 0)


@dataclass(frozen=True)
class State:
    """Where the robot is and how fast it moves, as expressions.

    Attributes:
        position, velocity: of the moving joints [rad or m, rad/s or m/s], n x 1.
        attitude: quaternion of the base, 4 x 1.
        base_velocity: [rd_0; omega_0] in base axes [m/s, rad/s], 6 x 1.
        base_position: origin of the base frame in the inertial frame [m], 3 x 1.
    """

    position: ca.SX
    velocity: ca.SX
    attitude: ca.SX
    base_velocity: ca.SX
    base_position: ca.SX


@dataclass(frozen=True)
class BodyState:
    """One body's part of the recursion, in its own axes unless said otherwise.

    Attributes:
        transfer: T_ij, from the inboard body's velocity column to this one's; empty for the base.
        hinge: U_i, columns of this body's own coordinates, 6 x (number of them).
        bias: beta_i [m/s^2, rad/s^2], 6 x 1.
        velocity: v_i, 6 x 1.
        rotation: A_i, body to inertial axes, 3 x 3.
        position: r_i, origin in the inertial frame [m], 3 x 1.
    """

    transfer: ca.SX
    hinge: ca.SX
    bias: ca.SX
    velocity: ca.SX
    rotation: ca.SX
    position: ca.SX


def tree_of(robot: Robot) -> Tree:
    """The constants of the recursion, from a checked description."""
    joints = tuple(joint.name for joint in robot.moving_joints)
    bodies = [Body("base")]
    index = {"base": 0}
    for joint in robot.tree:
        index[joint.child] = len(bodies)
        bodies.append(
            Body(
                name=joint.child,
                parent=index[joint.parent],
                kind=joint.kind,
                coordinate=joints.index(joint.name) if joint.kind != "fixed" else -1,
                rotation=rotation_from_rpy(joint.rpy),
                origin=np.asarray(joint.origin, dtype=float),
                axis=joint.unit_axis,
            )
        )
    return Tree(tuple(bodies), joints, robot.base.kind == "free")


def recursion(tree: Tree, state: State) -> tuple[BodyState, ...]:
    """Every body's transfer, hinge columns, bias and velocity, from the base outwards."""
    states = [_base(tree, state)]
    for body in tree.bodies[1:]:
        states.append(_outboard(body, states[body.parent], state))
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
    )


def _outboard(body: Body, inboard: BodyState, state: State) -> BodyState:
    """One step of the recursion across the inboard joint of `body`."""
    axis = ca.sparsify(ca.SX(body.axis))
    origin = ca.sparsify(ca.SX(body.origin))
    rotation = ca.sparsify(ca.SX(body.rotation))  # child -> inboard axes
    omega = inboard.velocity[3:6]
    kind = body.kind
    rate = state.velocity[body.coordinate] if body.coordinate >= 0 else ca.SX(1, 1)
    hinge, sliding = ca.SX(6, 0), ca.SX(3, 1)
    if kind == "revolute":
        hinge = ca.vertcat(ca.SX(3, 1), axis)
        rotation = rotation @ rotation_about(body.axis, state.position[body.coordinate])
    elif kind == "prismatic":
        hinge = ca.vertcat(axis, ca.SX(3, 1))
        origin = origin + rotation @ axis * state.position[body.coordinate]
        sliding = rotation @ axis * rate
    turn = rotation.T
    # T_ij = [A_ij, -A_ij rho~; 0, A_ij], rho from the inboard origin to this one, in inboard axes
    transfer = ca.blockcat([[turn, -turn @ skew(origin)], [ca.SX(3, 3), turn]])
    velocity = transfer @ inboard.velocity + (hinge * rate if kind != "fixed" else 0)
    # beta_i = [om_j~ om_j~ rho + 2 om_j~ H sd; om_i~ H thetad]
    centripetal = turn @ (ca.cross(omega, ca.cross(omega, origin)) + 2 * ca.cross(omega, sliding))
    gyroscopic = ca.cross(velocity[3:6], axis * rate) if kind == "revolute" else ca.SX(3, 1)
    return BodyState(
        transfer=transfer,
        hinge=hinge,
        bias=ca.vertcat(centripetal, gyroscopic),
        velocity=velocity,
        rotation=inboard.rotation @ rotation,
        position=inboard.position + inboard.rotation @ origin,
    )
