"""Joint reactions by Lagrange multipliers: every joint cut, its constraints added as equations.

Each body moves by itself under M_i vd_i = f_i + (Phi^T lambda)_i, and the joints demand Phi vd = gamma of the
accelerations of all bodies together: of the twist of the outboard node against the inboard one, all
directions in which the joint is not free. Phi and gamma come from the places of the nodes alone, by
differentiating them twice. Torques act along the free directions as applied forces, rotors as masses on them.
One system holds all accelerations and multipliers,

    [M, -Phi^T; Phi, 0] [vd; lambda] = [f; gamma],

and gives what `reference_model.dynamics.equations` finds by recursion: nothing is shared but the bodies' own
matrices. It is solved by numbers; n bodies cost O(n^3). Literature: Shabana, Dynamics of Multibody Systems,
4th ed. 2013, ch. 3; the multipliers of a joint are its ideal constraint force in the directions of its
constraints.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_model.dynamics.equations import applied, body_matrix
from reference_model.dynamics.joints import node_of
from reference_model.dynamics.symbolic import SymbolicRobot
from reference_model.dynamics.tree import Body
from reference_model.evaluation.model import RobotModel
from reference_model.kinematics.spatial import constant, rows_of, skew
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion
from robot_model import InputError

__all__ = ["CutMotion", "cut_motion"]

Array = NDArray[np.float64]

#: Rows of a rigid body's column, [linear; angular].
BASE = 6


@dataclass(frozen=True)
class CutMotion:
    """Result of the cut system, for all bodies except the base in tree order.

    Attributes:
        bodies: their names.
        accelerations: acceleration column of each, [linear; angular; modal] in its axes, (N, 6 + s_i) each.
        wrenches: [force; moment] by the inboard body at its inboard joint, about it and in its axes, or in
            those of its root where that moves in its frame, shape (N, bodies, 6).
    """

    bodies: tuple[str, ...]
    accelerations: tuple[Array, ...]
    wrenches: Array


def cut_motion(
    model: RobotModel,
    position: ArrayLike,
    velocity: ArrayLike,
    force: ArrayLike,
    *,
    base: BaseMotion | None = None,
    inner: InnerMotion | None = None,
    inertial: ArrayLike | None = None,
) -> CutMotion:
    """Accelerations and joint wrenches of all bodies under generalised forces.

    Args:
        model: the robot.
        position, velocity: of the one-coordinate joints, shape (N, n).
        force: generalised forces in the order of `tree.Tree`, shape (N, rows).
        base, inner, inertial: as of `RobotModel`.
    """
    still = np.zeros_like(np.asarray(position, dtype=float))
    given = (base, inner, inertial)
    found = model.evaluate(cut_system, (position, velocity, still), given, np.asarray(force, dtype=float))
    tree = model.tree
    size = sum(BASE + body.modes for body in tree.bodies)
    joints = BASE * (len(tree.bodies) - 1)
    locked = found[3].shape[1]
    shapes = (
        (size, size),
        (size, 1),
        (locked, size),
        (locked, 1),
        (joints, locked),
        (joints, size),
        (joints, 1),
    )
    mass, force_column, phi, gamma, held, rotors, driven = (
        flat.reshape(len(flat), *shape[::-1]).transpose(0, 2, 1) for flat, shape in zip(found, shapes)
    )
    zero = np.zeros((len(phi), locked, locked))
    system = np.block([[mass, -phi.transpose(0, 2, 1)], [phi, zero]])
    solved = np.linalg.solve(system, np.concatenate([force_column, gamma], axis=1))
    column, multipliers = solved[:, :size], solved[:, size:]
    wrenches = (held @ multipliers + driven - rotors @ column).reshape(len(phi), -1, BASE)
    ends = np.cumsum([BASE + body.modes for body in tree.bodies])[:-1]
    columns = tuple(np.split(column[:, :, 0], ends, axis=1)[1:])
    return CutMotion(tuple(body.name for body in tree.bodies[1:]), columns, wrenches)


def cut_system(robot: SymbolicRobot, force: ca.SX) -> list[ca.SX]:
    """M, f, Phi, gamma; then held, rotors, driven, of the wrenches held lambda - rotors vd + driven.

    The columns of all bodies stand one below the other, the base first.
    """
    mechanism, tree = robot.mechanism, robot.tree
    if mechanism.is_coupled:
        raise InputError(
            f"robot '{robot.robot.name}': joints are not cut where rotors of a transmission couple them; use "
            "joint_wrenches instead."
        )
    starts = np.concatenate([[0], np.cumsum([BASE + body.modes for body in tree.bodies])]).tolist()
    mass = ca.diagcat(*(body_matrix(mechanism, index) for index in range(len(tree.bodies))))
    forces = ca.vertcat(*(applied(mechanism, index) for index in range(len(tree.bodies))))
    rows, wanted, directions, rotors, driven = [], [], [], [], []
    if tree.free_base:
        forces[:BASE] += force[:BASE]
    else:
        rows.append(ca.horzcat(ca.SX.eye(BASE), ca.SX(BASE, starts[-1] - BASE)))
        wanted.append(robot.motion.base_acceleration)
    for index, body in enumerate(tree.bodies[1:], start=1):
        twist = ca.SX(BASE, starts[-1])
        inner, outer, bias = _relative_twist(robot, body, index)
        twist[:, starts[body.parent] : starts[body.parent + 1]] = inner
        twist[:, starts[index] : starts[index + 1]] = outer
        free, held = _directions(body)
        rows.append(held.T @ twist)
        wanted.append(-held.T @ bias)
        directions.append(held)
        own, hinges = tree.own(index), len(tree.own(index)) - body.modes
        reflected = mechanism.rotor(index)[:hinges, :hinges]
        rotors.append(free @ reflected @ free.T @ twist)
        driven.append(free @ (rows_of(force, own[:hinges]) - reflected @ free.T @ bias))
        mass += twist.T @ rotors[-1]
        forces += twist.T @ driven[-1]
        forces[starts[index] + BASE : starts[index + 1]] += rows_of(force, own[hinges:])
    held = ca.diagcat(*directions)
    if not tree.free_base:  # the multipliers of the base's own constraints are no joint's wrench
        held = ca.horzcat(ca.SX(held.shape[0], BASE), held)
    return [
        mass,
        forces,
        ca.vertcat(*rows),
        ca.vertcat(*wanted),
        held,
        ca.vertcat(*rotors),
        ca.vertcat(*driven),
    ]


def _directions(body: Body) -> tuple[ca.SX, ca.SX]:
    """Free and held directions of the inboard joint among [linear; angular] in its outboard axes."""
    axis = body.axis / np.linalg.norm(body.axis)
    plane = np.linalg.svd(axis[None])[2][1:].T  # two directions across the axis
    still, every = np.zeros((3, 3)), np.eye(3)
    linear, angular = {
        "revolute": (still[:, :0], axis[:, None]),
        "prismatic": (axis[:, None], still[:, :0]),
        "spherical": (still[:, :0], every),
        "fixed": (still[:, :0], still[:, :0]),
    }[body.kind]
    held_linear = plane if linear.shape[1] else every
    held_angular = every[:, : 3 - angular.shape[1]] if angular.shape[1] in (0, 3) else plane
    return _blocks(linear, angular), _blocks(held_linear, held_angular)


def _blocks(linear: Array, angular: Array) -> ca.SX:
    return ca.diagcat(constant(linear), constant(angular))


def _relative_twist(robot: SymbolicRobot, body: Body, index: int) -> tuple[ca.SX, ca.SX, ca.SX]:
    """[linear; angular] velocity of node P against the frame of node Q, in the axes of P: by the two bodies'
    velocity columns, and what its rate has besides those matrices times the acceleration columns."""
    parent = robot.tree.bodies[body.parent]
    function = _twist_function(parent, body)
    states = robot.mechanism.states
    arguments = [
        part
        for state in (states[body.parent], states[index])
        for part in (state.rotation, state.position, state.modal, state.velocity)
    ]
    inner, outer, bias = function(*arguments)
    return inner, outer, bias


def _twist_function(parent: Body, body: Body) -> ca.Function:
    inner, outer = (_Free(member) for member in (parent, body))
    q_place, q_turn = inner.node(body.node, body.origin)
    p_place, p_turn = outer.node(body.flexible.root if body.flexible else -1, np.zeros(3))

    def rate(expression: ca.SX, *, velocities: bool = False) -> ca.SX:
        """Time derivative of an expression of places, or of velocities too while no body accelerates."""
        changes = [change for member in (inner, outer) for change in member.changes(velocities=velocities)]
        return sum(
            (ca.jtimes(expression, symbol, by) for symbol, by in changes), start=ca.SX(*expression.shape)
        )

    omega_q, omega_p = (_axial(rate(turn) @ turn.T) for turn in (q_turn, p_turn))
    drift = rate(p_place) - rate(q_place) - ca.cross(omega_q, p_place - q_place)
    twist = ca.vertcat(p_turn.T @ drift, p_turn.T @ (omega_p - omega_q))
    jacobians = [ca.jacobian(twist, member.velocity) for member in (inner, outer)]
    bias = rate(twist, velocities=True)
    symbols = [symbol for member in (inner, outer) for symbol in member.symbols]
    return ca.Function("twist", symbols, [*jacobians, bias], {"cse": True})


class _Free:
    """A body that moves by itself: symbols of its place and velocity, and how they change."""

    def __init__(self, body: Body) -> None:
        self.body = body
        self.rotation, self.position = ca.SX.sym("A", 3, 3), ca.SX.sym("r", 3)
        self.modal, self.velocity = ca.SX.sym("x", body.modes), ca.SX.sym("v", BASE + body.modes)
        self.symbols = (self.rotation, self.position, self.modal, self.velocity)

    def node(self, index: int, origin: Array) -> tuple[ca.SX, ca.SX]:
        """Place and axes of a node in the inertial frame, or of a point of a rigid body."""
        still = ca.SX(self.body.modes, 1)
        flexible = self.body.flexible
        if flexible is None:
            return self.position + self.rotation @ constant(origin), self.rotation
        found = node_of(flexible, index, self.modal, still)
        return self.position + self.rotation @ found.place, self.rotation @ found.rotation

    def changes(self, *, velocities: bool) -> list[tuple[ca.SX, ca.SX]]:
        """Each symbol with its time derivative; velocities change as those of a body with no acceleration.

        In turning axes the components of a constant velocity change by -om x v.
        """
        linear, omega = self.velocity[:3], self.velocity[3:6]
        found = [
            (self.rotation, self.rotation @ skew(omega)),
            (self.position, self.rotation @ linear),
            (self.modal, self.velocity[BASE:]),
        ]
        turned = ca.vertcat(-ca.cross(omega, linear), ca.SX(3 + self.body.modes, 1))
        return [*found, (self.velocity, ca.densify(turned))] if velocities else found


def _axial(matrix: ca.SX) -> ca.SX:
    """The vector a of a skew matrix a~."""
    return ca.vertcat(matrix[2, 1], matrix[0, 2], matrix[1, 0])
