"""The closed loop as one set of ordinary differential equations.

Accelerations, bearing loads and friction depend on one another when friction depends on the loads: the
loads follow from the accelerations, those from the friction, and it from the loads. Accelerations and
reaction wrenches are affine in the joint forces, so this loop is closed inside the expression by a few
Newton passes over n unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.acting import JointForces, Signals, inertial_with
from reference_model.balance import LOADS, momentum
from reference_model.control import Goal, command, command_size, drive, has_integral, holds_base
from reference_model.decoupling import BASE_ROWS
from reference_model.effects.catalogue import used_effects
from reference_model.inertial import nominal_inertial
from reference_model.layout import Layout
from reference_model.loop import Affine, fixed_point
from reference_model.spatial import quaternion_from_rpy, quaternion_rate, rotation_from_quaternion
from reference_model.symbolic import Motion, SymbolicRobot
from robot_model import Robot

__all__ = ["Plant", "Response"]


@dataclass(frozen=True)
class Response:
    """What the robot does in a state under actuator torques.

    Attributes:
        acceleration: generalised accelerations, base first, rows x 1.
        friction: friction at the joints [N m or N], n x 1.
        loads: of the bearings, rows `balance.LOADS`, 4 x n.
        rates: of the effects' states.
        residual: largest error left in the loop of loads and friction, relative to 1 + the forces.
    """

    acceleration: ca.SX
    friction: ca.SX
    loads: ca.SX
    rates: ca.SX
    residual: ca.SX


class Plant:
    """A robot with its effects and its controller, as functions of time and state.

    Args:
        robot: the description.

    Attributes:
        layout: the parts of the state.
        wrench: rows of the base wrench at the head of a command, 6 or 0.
        commands: rows of a command.
        forces: the effects at the joints.
        inertial: true inertial numbers, shape (P,); the controller believes in the nominal ones.
        command: (t, x, r, rd, rdd) -> command of the controller.
        rate: (t, x, r, command) -> time derivative of the state.
        watch: (t, x, r, command) -> columns of `WATCHED`.
    """

    #: What `watch` returns, in order; each a dense column.
    WATCHED = ("torque", "acceleration", "friction", "loads", "energy", "linear", "angular", "residual")

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        effects = used_effects(robot)
        self.forces = JointForces(robot, effects)
        self.nominal = nominal_inertial(robot)
        self.inertial = inertial_with(robot, self.nominal, effects)
        count = len(robot.moving_joints)
        free = robot.base.kind == "free"
        self.layout = Layout(count, free, self.forces.states, has_integral(robot))
        self.commands = command_size(robot)
        self.wrench = BASE_ROWS if holds_base(robot) else 0
        self._build(count)

    def _build(self, count: int) -> None:
        time, state = ca.SX.sym("t"), ca.SX.sym("x", self.layout.size)
        reference = [ca.SX.sym(name, count) for name in ("r", "rd", "rdd")]
        held = ca.SX.sym("command", self.commands)
        parts = self.layout.split(state)
        motion = self._motion(parts)
        wish = command(
            self.robot,
            motion,
            Goal(reference[0], reference[1], reference[2], parts["integral"]),
            self.nominal,
        )
        self.command = ca.Function("command", [time, state, *reference], [ca.densify(wish)], {"cse": True})
        torque = drive(self.robot, held[self.wrench :], motion.velocity)
        response = self._respond(time, motion, held[: self.wrench], torque, parts["effects"])
        rate = self._rate(parts, reference[0], response)
        inputs = [time, state, reference[0], held]
        self.rate = ca.Function("rate", inputs, [rate], {"cse": True})
        truth = SymbolicRobot(self.robot, motion, ca.SX(self.inertial))
        watched = [torque, response.acceleration, response.friction, response.loads, truth.energy]
        watched += [*momentum(truth.mechanism), response.residual]
        columns = [ca.vec(ca.densify(value)) for value in watched]
        self.watch = ca.Function("watch", inputs, columns, {"cse": True})

    def initial(self, reference: ca.Function) -> NDArray[np.float64]:
        """The state at time 0, shape (rows,); `reference` gives r, rd, rdd of the time.

        Effects begin as they would be under the first commanded torque.
        """
        robot = self.robot
        position = np.array([joint.initial_position for joint in robot.moving_joints])
        velocity = np.array([joint.initial_velocity for joint in robot.moving_joints])
        base = [*robot.base.position, *quaternion_from_rpy(robot.base.rpy)] if self.layout.free_base else []
        turning = [0.0] * 6 if self.layout.free_base else []
        hidden = np.zeros(self.layout.effect_states + self.layout.sizes["integral"])
        state = np.concatenate([base, position, turning, velocity, hidden])
        goal = reference(0.0)
        torque = self.watch(0.0, state, goal[0], self.command(0.0, state, *goal))[0]
        still, loads = ca.SX(len(position), 1), ca.SX(len(LOADS), len(position))
        signals = Signals(ca.SX(0.0), ca.SX(position), ca.SX(velocity), still, ca.SX(torque), loads)
        effects = self.layout.split(state)["effects"]  # a view of its rows
        effects[:] = ca.evalf(self.forces.initial(signals)).full().ravel()
        return state

    def _motion(self, parts: dict[str, ca.SX]) -> Motion:
        base = SymbolicRobot.still_base(self.robot)
        if self.layout.free_base:
            base |= {name: parts[name] for name in ("attitude", "base_velocity", "base_position")}
        still = ca.SX(self.layout.joints, 1)
        return Motion(parts["position"], parts["velocity"], still, **base)

    def _rate(self, parts: dict[str, ca.SX], reference: ca.SX, response: Response) -> ca.SX:
        """Time derivative of the state; the base's velocity is kept in base axes, so om x v is taken off."""
        integral = [reference - parts["position"]] if self.layout.integral else []
        if not self.layout.free_base:
            moving = [parts["velocity"], response.acceleration]
            return ca.densify(ca.vertcat(*moving, response.rates, *integral))
        linear, omega = parts["base_velocity"][:3], parts["base_velocity"][3:]
        rotation = rotation_from_quaternion(parts["attitude"])
        apparent = ca.vertcat(ca.cross(omega, linear), ca.SX(3, 1))
        return ca.densify(
            ca.vertcat(
                rotation @ linear,
                quaternion_rate(parts["attitude"], omega),
                parts["velocity"],
                response.acceleration[:6] - apparent,
                response.acceleration[6:],
                response.rates,
                *integral,
            )
        )

    def _respond(self, time: ca.SX, motion: Motion, wrench: ca.SX, torque: ca.SX, states: ca.SX) -> Response:
        offset, count = 6 if self.layout.free_base else 0, self.layout.joints
        pushed = wrench if self.wrench else ca.SX(offset, 1)
        numbers = ca.SX(self.inertial)
        robot = SymbolicRobot(self.robot, motion, numbers)

        def accelerations(force: ca.SX) -> ca.SX:
            return robot.forward_dynamics(ca.vertcat(pushed, torque + force))

        def reactions(acceleration: ca.SX) -> ca.SX:
            moved = replace(motion, acceleration=acceleration[offset:])
            if offset:
                moved = replace(moved, base_acceleration=acceleration[:6])
            return SymbolicRobot(self.robot, moved, numbers).joint_wrenches

        def both(force: ca.SX) -> ca.SX:
            moved = accelerations(force)
            return ca.vertcat(moved, ca.vec(reactions(moved)))

        def signals(column: ca.SX) -> Signals:
            rows = column.shape[0] - 6 * count
            loads = robot.bearing_loads(ca.reshape(column[rows:], 6, count))
            acceleration = column[offset : offset + count]
            return Signals(time, motion.position, motion.velocity, acceleration, torque, loads)

        def forces(column: ca.SX) -> ca.SX:
            return self.forces.act(signals(column), states)[0]

        if self.forces.needs_solving():
            caused = Affine.of(both, count)
            force = fixed_point(forces, caused)
            column = caused.at(force)
        else:
            force = forces(both(ca.SX(count, 1)))
            column = both(force)
        seen = signals(column)
        total, rates, friction = self.forces.act(seen, states)
        residual = ca.mmax(ca.fabs(total - force) / (1 + ca.fabs(total)))
        return Response(column[: -6 * count], friction, seen.loads, rates, residual)
