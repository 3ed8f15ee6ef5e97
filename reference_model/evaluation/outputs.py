"""Results of the methods of `RobotModel`, as expressions."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from reference_model.dynamics.balance import momentum
from reference_model.dynamics.minimal import minimal_form
from reference_model.dynamics.symbolic import SymbolicRobot

__all__ = [
    "body",
    "energy",
    "forward",
    "inverse",
    "jacobians",
    "loads",
    "mass",
    "minimal",
    "momenta",
    "node",
    "regressor",
    "wrenches",
]


def inverse(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Generalised force."""
    return [robot.inverse_dynamics]


def regressor(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Derivative of the generalised force with respect to inertial parameters."""
    return [_rows_first(ca.jacobian(robot.inverse_dynamics, robot.inertial))]


def jacobians(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Derivatives of the generalised force with respect to joint position, velocity and acceleration."""
    motion = robot.motion
    by = (motion.position, motion.velocity, motion.acceleration)
    return [_rows_first(ca.jacobian(robot.inverse_dynamics, variable)) for variable in by]


def wrenches(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Wrenches at the one-coordinate joints."""
    return [robot.joint_wrenches]


def loads(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Bearing loads of the one-coordinate joints."""
    return [robot.bearing_loads(robot.joint_wrenches)]


def mass(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Z."""
    return [robot.mass_matrix]


def minimal(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Z and z of the explicit form."""
    return list(minimal_form(robot.mechanism, robot.motion.base_acceleration))


def forward(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Generalised accelerations; `extra` holds the base's wrench and the forces on the inner coordinates."""
    wrench, pushed = ca.vertsplit(extra, [0, robot.tree.offset, extra.shape[0]])
    return [robot.forward_dynamics(ca.vertcat(wrench, robot.motion.acceleration, pushed))]


def momenta(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Linear momentum, and angular momentum about the centre of mass."""
    return list(momentum(robot.mechanism))


def energy(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Kinetic, gravitational and elastic energy."""
    return [ca.vertcat(*robot.energies)]


def body(link: str) -> Callable[[SymbolicRobot, ca.SX], list[ca.SX]]:
    """Motion of a rigid body, and generalised forces of unit wrench components at its origin."""

    def build(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
        state, motion = robot.mechanism.states[robot.tree.index(link)], robot.motion
        base = motion.base_velocity if robot.tree.free_base else ca.SX(0, 1)
        rates = ca.vertcat(base, motion.velocity, motion.ball_rates, motion.modal_rates)
        velocity = state.velocity[:6]
        return [state.position, state.rotation, velocity, ca.jacobian(velocity, rates)]

    return build


def node(link: str, index: int) -> Callable[[SymbolicRobot, ca.SX], list[ca.SX]]:
    """Motion of a node of a flexible link."""

    def build(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
        body = robot.tree.index(link)
        state, flexible = robot.mechanism.states[body], robot.tree.bodies[body].flexible
        assert flexible is not None
        place, turn, velocity, acceleration = robot.node(body, index)
        return [
            state.position + state.rotation @ place,
            state.rotation @ turn,
            velocity[:3],
            acceleration[:3],
            place - ca.SX(flexible.nodes[index]),
        ]

    return build


def _rows_first(matrix: ca.SX) -> ca.SX:
    """A matrix whose column-major order is the row-major order of the given one."""
    return ca.densify(matrix).T
