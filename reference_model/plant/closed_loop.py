"""The closed loop as one set of ordinary differential equations.

If friction depends on bearing loads, the equations are coupled: loads follow from accelerations,
accelerations from friction, and friction from loads. Accelerations and
reaction wrenches are affine in the joint forces, so this loop is closed inside the expression by a few
Newton passes over n unknowns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.control.adaptive_network import network_of
from reference_model.control.decoupling import BASE_ROWS
from reference_model.control.laws import Goal, command, command_size, drive, has_integral, holds_base
from reference_model.dynamics.balance import LOADS, momentum, structural_loss
from reference_model.dynamics.inertial import nominal_inertial
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.dynamics.tree import Body
from reference_model.joint.losses import losses
from reference_model.kinematics.spatial import quaternion_from_rpy, quaternion_rate, rotation_from_quaternion
from reference_model.plant.acting import JointForces, Signals
from reference_model.plant.gears import reads_motor
from reference_model.plant.layout import Layout
from reference_model.plant.loop import Affine, fixed_point
from reference_model.plant.response import Response
from reference_model.plant.truth import truth_of
from robot_model import InputError, Robot

__all__ = ["TIP_NUMBERS", "Plant", "Response"]

#: Rows of a flexible link's tip in `watch`: deflection and acceleration.
TIP_NUMBERS = 6


class Plant:
    """A robot with its effects and its controller, as functions of time and state.

    Args:
        robot: the description.
        work: the work of all forces is also a state.
        losses: the energies dissipated by friction and windings are also states.

    Attributes:
        truth: the true robot; `robot` is the controller's model.
        layout: the parts of the state.
        tree: bodies and coordinates.
        wrench: rows of the base wrench at the beginning of a command, 6 or 0.
        commands: rows of a command.
        forces: the effects at the joints.
        gears: of the drives with a separate motor coordinate.
        network: of an adaptive controller; its weights are states.
        inertial: true inertial parameters, shape (P,); the controller uses the nominal ones.
        command: (t, x, r, rd, rdd) -> command of the controller.
        rate: (t, x, r, command) -> time derivative of the state.
        watch: (t, x, r, command) -> columns of `WATCHED`.
    """

    #: What `watch` returns, in order; each a dense column.
    WATCHED: ClassVar[tuple[str, ...]] = (
        "torque",
        "acceleration",
        "friction",
        "loads",
        "energy",
        "linear",
        "angular",
        "residual",
        "tips",
        "gears",
        "temperature",
        "contact",
    )

    #: Symbols of prescribed joint modes where stick and slip are exact; None smooths dry friction.
    mode: ca.SX | None = None

    def __init__(self, robot: Robot, *, work: bool = False, losses: bool = False) -> None:
        self.robot = robot
        self.truth = truth_of(robot)
        self.gears, effects = self.truth.gears, self.truth.effects
        self.forces = JointForces(robot, effects, self.gears.drives)
        if self.mode is not None and self.forces.dry_motors:
            raise InputError(
                f"robot '{robot.name}', motor '{self.forces.dry_motors[0]}': exact stick and slip is of "
                "joints, and it moves several; simulate without stiction, or state the friction at joints."
            )
        self.nominal, self.inertial = nominal_inertial(robot), self.truth.inertial
        count = len(robot.moving_joints)
        self.tree = self.truth.tree
        balls, modal = len(self.tree.balls), self.tree.modal
        self.network = network_of(robot)
        weights = self.network.centres * count if self.network else 0
        more = len(self.gears.drives), self.gears.states, self.truth.forces.states, weights, losses
        self.layout = Layout(
            count, self.tree.free_base, self.forces.states, has_integral(robot), balls, modal, work, *more
        )
        self.commands = command_size(robot)
        self.wrench = BASE_ROWS if holds_base(robot) else 0
        self._build(count)

    def _build(self, count: int) -> None:
        time, state = ca.SX.sym("t"), ca.SX.sym("x", self.layout.size)
        reference = [ca.SX.sym(name, count) for name in ("r", "rd", "rdd")]
        held = ca.SX.sym("command", self.commands)
        parts = self.layout.split(state)
        motion = self._motion(parts)
        self._outer = time, parts["outer"]
        wish = command(
            self.robot,
            self._read(self.truth.believed(motion), parts),
            Goal(reference[0], reference[1], reference[2], parts["integral"], parts["weights"]),
            self.nominal,
        )
        self.command = ca.Function("command", [time, state, *reference], [ca.densify(wish)], {"cse": True})
        turning = self.gears.motion(motion.velocity, parts["motor_rates"])
        torque = drive(self.robot, held[self.wrench :], turning)
        response = self._respond(time, motion, held[: self.wrench], torque, parts)
        rate = self.rate_with(parts, reference[0], held, response)
        inputs = [time, state, reference[0], held, *([] if self.mode is None else [self.mode])]
        self._inputs, self._found = inputs, (rate, ca.vertcat(response.acceleration, response.force))
        self.rate = ca.Function("rate", inputs, [rate], {"cse": True})
        truth = self._true(motion)
        rotors = ca.dot(self.gears.inertia, parts["motor_rates"] ** 2) / 2
        energy = truth.energy + rotors + response.gears.stored
        watched = [torque, response.acceleration, response.friction, response.loads, energy]
        watched += [*momentum(truth.mechanism), response.residual, self._tips(motion, response.acceleration)]
        watched += [response.gears.torque, self.forces.warmth(time, parts["effects"])]
        watched += [self.forces.contact_forces(motion.position, motion.velocity, parts["effects"])]
        columns = [ca.vec(ca.densify(value)) for value in watched]
        self.watch = ca.Function("watch", inputs, columns, {"cse": True})
        self._judge(inputs, response)

    @property
    def direction(self) -> ca.SX | None:
        """Sliding direction of the joints, -1, 0 or 1, n x 1; None smooths dry friction."""
        return self.mode

    @property
    def unknowns(self) -> int:
        """The coupled unknowns: generalised accelerations and the effects' forces on the joints."""
        return self.tree.rows + self.layout.joints

    def solved(self) -> ca.Function:
        """(t, x, r, command) -> time derivative of the state, and the solved unknowns."""
        return ca.Function("solved", self._inputs, [ca.densify(part) for part in self._found], {"cse": True})

    def implicit(self) -> ca.Function:
        """(t, x, r, command, unknowns) -> time derivative with these unknowns, and their equation residual.

        The residual is zero at those of `solved`. Derivatives of both are short, since nothing is solved.
        """
        time, state, reference, held = self._inputs
        parts = self.layout.split(state)
        motion = self._motion(parts)
        torque = drive(
            self.robot, held[self.wrench :], self.gears.motion(motion.velocity, parts["motor_rates"])
        )
        unknown = ca.SX.sym("unknown", self.unknowns)
        response = self._respond(time, motion, held[: self.wrench], torque, parts, unknown)
        rate = self.rate_with(parts, reference, held, response)
        inputs = [*self._inputs, unknown]
        return ca.Function("implicit", inputs, [rate, ca.densify(response.gap)], {"cse": True})

    def _judge(self, inputs: list[ca.SX], response: Response) -> None:
        """Additional functions of derived plants."""

    def initial(self, reference: ca.Function) -> NDArray[np.float64]:
        """The state at time 0, shape (rows,); `reference` gives r, rd, rdd of the time.

        Effects and gears start in equilibrium with the first commanded torque.
        """
        robot = self.robot
        position = np.array([joint.initial_position for joint in robot.moving_joints])
        velocity = np.array([joint.initial_velocity for joint in robot.moving_joints])
        state = np.zeros(self.layout.size)
        parts = self.layout.split(state)  # views of its rows
        parts["position"][:], parts["velocity"][:] = position, velocity
        geared, coupling = list(self.gears.drives), robot.coupling
        parts["motor"][:] = (coupling @ position)[geared]
        parts["motor_rates"][:] = (coupling @ velocity)[geared]
        parts["balls"][::4] = 1.0
        parts["outer"][:] = self.truth.forces.initial
        parts["ball_rates"][:] = np.ravel(
            [joint.initial_angular_velocity for joint in robot.spherical_joints]
        )
        if self.layout.free_base:
            parts["base_position"][:] = robot.base.position
            parts["attitude"][:] = quaternion_from_rpy(robot.base.rpy)
        twist, parts["gears"][:] = self.gears.at_rest(self._first_torque(reference, state))
        parts["motor"][:] += twist
        torque = self._first_torque(reference, state)
        still, loads = ca.SX(len(position), 1), ca.SX(len(LOADS), len(position))
        driven = self.gears.coupling.on_joints(ca.SX(torque))
        signals = Signals(ca.SX(0.0), ca.SX(position), ca.SX(velocity), still, driven, loads)
        parts["effects"][:] = ca.evalf(self.forces.initial(signals)).full().ravel()
        return state

    def _first_torque(self, reference: ca.Function, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Commanded torque of the drives at time 0, shape (n,)."""
        goal = reference(0.0)
        mode = [] if self.mode is None else [np.ones(self.mode.shape[0])]
        found = self.watch(0.0, state, goal[0], self.command(0.0, state, *goal), *mode)[0]
        return np.asarray(found, dtype=float).ravel()

    def _read(self, motion: Motion, parts: dict[str, ca.SX]) -> Motion:
        """The motion as measured by the controller's encoders."""
        if not reads_motor(self.robot):
            return motion
        position = self.gears.seen(motion.position, parts["motor"])
        velocity = self.gears.seen(motion.velocity, parts["motor_rates"])
        return replace(motion, position=position, velocity=velocity)

    def _motion(self, parts: dict[str, ca.SX]) -> Motion:
        base = SymbolicRobot.still_base(self.robot)  # effects do not move it at the start
        if self.layout.free_base:
            base |= {name: parts[name] for name in ("attitude", "base_velocity", "base_position")}
        base |= {name: parts[name] for name in ("balls", "ball_rates", "modal", "modal_rates")}
        base["inner_acceleration"] = ca.SX(self.tree.inner, 1)
        still = ca.SX(self.layout.joints, 1)
        return Motion(parts["position"], parts["velocity"], still, **base)

    def rate_with(
        self, parts: dict[str, ca.SX], reference: ca.SX, command: ca.SX, response: Response
    ) -> ca.SX:
        """Time derivative of the state; the base's velocity is in base axes, so om x v is subtracted."""
        acceleration, turned = response.acceleration, []
        for k in range(self.layout.balls):
            quaternion = parts["balls"][4 * k : 4 * k + 4]
            turned.append(quaternion_rate(quaternion, parts["ball_rates"][3 * k : 3 * k + 3]))
        places = [parts["velocity"], *turned, parts["modal_rates"], parts["motor_rates"]]
        if self.layout.free_base:
            linear, omega = parts["base_velocity"][:3], parts["base_velocity"][3:]
            rotation = rotation_from_quaternion(parts["attitude"])
            places = [rotation @ linear, quaternion_rate(parts["attitude"], omega), *places]
            apparent = ca.vertcat(ca.cross(omega, linear), ca.SX(self.tree.rows - 3, 1))
            acceleration = acceleration - apparent
        moved = [acceleration, response.motors, response.gears.rates, response.rates, response.outer]
        seen = self._read(self._motion(parts), parts)
        error = reference - seen.position
        integral = [error] if self.layout.integral else []
        if self.network is not None:
            basis = self.network.basis(seen.position, seen.velocity)
            integral.append(self.network.rates(parts["weights"], basis, command[-self.layout.joints :]))
        work = [response.power] if self.layout.work else []
        if self.layout.losses:
            work.append(ca.vertcat(*losses(self.robot, response.friction, parts["velocity"], response.drive)))
        return ca.densify(ca.vertcat(*places, *moved, *integral, *work))

    def _respond(
        self,
        time: ca.SX,
        motion: Motion,
        wrench: ca.SX,
        torque: ca.SX,
        parts: dict[str, ca.SX],
        assumed: ca.SX | None = None,
    ) -> Response:
        """Response of the robot; with `assumed` unknowns, the response to these and their residual."""
        offset, count, states = 6 if self.layout.free_base else 0, self.layout.joints, parts["effects"]
        pushed = wrench if self.wrench else ca.SX(offset, 1)
        robot = self._true(motion)
        motor = [parts[name] for name in ("motor", "motor_rates")]
        geared, coupling = self.gears.rows, self.gears.coupling
        turned = self.gears.shafts(motion.velocity)
        twist, rate = motor[0] - self.gears.shafts(motion.position), motor[1] - turned
        gears = self.gears.act(twist, rate, parts["gears"])
        shaft = coupling.on_joints(self.gears.replaced(torque, gears.torque))

        def applied(force: ca.SX) -> ca.SX:
            return ca.vertcat(pushed, shaft + force, ca.SX(self.tree.inner, 1))

        def accelerations(force: ca.SX) -> ca.SX:
            return robot.forward_dynamics(applied(force))

        def reactions(acceleration: ca.SX) -> ca.SX:
            return self._true(self._moved(motion, acceleration)).joint_wrenches

        def both(force: ca.SX) -> ca.SX:
            moved = accelerations(force)
            return ca.vertcat(moved, ca.vec(reactions(moved)))

        def signals(column: ca.SX) -> Signals:
            rows = column.shape[0] - 6 * count
            loads = robot.bearing_loads(ca.reshape(column[rows:], 6, count))
            acceleration = column[offset : offset + count]
            moving = motion.position, motion.velocity, acceleration
            motors = [
                self.gears.motion(part, own) for part, own in zip((motion.position, motion.velocity), motor)
            ]
            driven = coupling.on_joints(torque)
            return Signals(time, *moving, driven, loads, self.direction, *motors)

        def forces(column: ca.SX) -> ca.SX:
            return self.forces.act(signals(column), states)[0]

        gap = ca.SX(0, 1)
        if assumed is None:
            force, column = self._settle(forces, both)
        else:
            moved, force = assumed[: self.tree.rows], assumed[self.tree.rows :]
            column = ca.vertcat(moved, ca.vec(reactions(moved)))
            needed = self._true(self._moved(motion, moved)).inverse_dynamics
            gap = ca.vertcat(needed - applied(force), forces(column) - force)
        seen = signals(column)
        driving = geared(torque + self.forces.on_motors(seen, states))
        power = ca.dot(shaft + force, motion.velocity) - ca.dot(gears.torque, turned)
        power += ca.dot(driving, motor[1]) - gears.loss - structural_loss(robot.mechanism)
        power += ca.dot(wrench, motion.base_velocity) if self.wrench else 0
        motors = (driving - gears.torque) / ca.SX(self.gears.inertia)
        outside = robot.mechanism.outside
        response = self._response(seen, states, force, column[: self.tree.rows])
        power += outside.power
        return replace(
            response,
            power=power,
            motors=motors,
            gears=gears,
            outer=outside.rates,
            force=force,
            drive=torque,
            gap=gap,
        )

    def _response(self, seen: Signals, states: ca.SX, force: ca.SX, acceleration: ca.SX) -> Response:
        """The response for given forces on the joints and the accelerations that they cause."""
        total, rates, friction = self.forces.act(seen, states)
        residual = ca.mmax(ca.vertcat(0, ca.fabs(total - force) / (1 + ca.fabs(total))))  # maybe no joints
        return Response(acceleration, friction, seen.loads, rates, residual)

    def _settle(
        self, forces: Callable[[ca.SX], ca.SX], caused: Callable[[ca.SX], ca.SX]
    ) -> tuple[ca.SX, ca.SX]:
        """The effects' forces on the joints, and the consistent accelerations and loads."""
        count = self.layout.joints
        if not self.forces.needs_solving():
            force = forces(caused(ca.SX(count, 1)))
            return force, caused(force)
        affine = Affine.of(caused, count)
        force = fixed_point(forces, affine)
        return force, affine.at(force)

    @property
    def flexible(self) -> tuple[Body, ...]:
        """Deformable bodies, in the order of the robot file."""
        bodies = {body.name: body for body in self.tree.bodies}
        return tuple(bodies[link.name] for link in self.truth.robot.flexible_links)

    def _tips(self, motion: Motion, acceleration: ca.SX) -> ca.SX:
        """Deflection and acceleration of the tip of each flexible link, 6 x (number of them)."""
        robot = self._true(self._moved(motion, acceleration))
        columns = [ca.SX(6, 0)]
        for body in self.flexible:
            assert body.flexible is not None
            tip = body.flexible.tip
            place, _, _, moved = robot.node(self.tree.bodies.index(body), tip)
            columns.append(ca.vertcat(place - ca.SX(body.flexible.nodes[tip]), moved[:3]))
        return ca.horzcat(*columns)

    def _true(self, motion: Motion) -> SymbolicRobot:
        """The true robot, with its effects, in a motion."""
        return self.truth.symbolic(motion, *self._outer)

    def _moved(self, motion: Motion, acceleration: ca.SX) -> Motion:
        """The motion with these generalised accelerations."""
        offset, count = self.tree.offset, self.layout.joints
        joints, inner = acceleration[offset : offset + count], acceleration[offset + count :]
        base = acceleration[:6] if offset else motion.base_acceleration
        return replace(motion, acceleration=joints, base_acceleration=base, inner_acceleration=inner)
