"""One step of a closed loop with dry friction that really sticks, as one CasADi expression.

Implicit midpoint in the smooth part; dry friction is set-valued and decided by the velocity at the end of
the step (Moreau's time stepping; Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems,
2008, ch. 10). A joint that sticks has velocity exactly zero, so it neither creeps nor chatters at any step
size; between stick and slip the step is of second order.

The residual of row i at the velocity v+ is ``g_i = inverse dynamics - actuator torque - effects``, with the
effects evaluated for sliding in a given direction. Solved is, for every joint,

    v+ > 0 and g_i(forwards) = 0,   or   v+ < 0 and g_i(backwards) = 0,
    or v+ = 0 and g_i(forwards) >= 0 >= g_i(backwards),

by Newton passes that revise the joints' directions as they go (a semismooth Newton method). Derivatives
follow from the implicit function theorem at the solution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

import casadi as ca

from missing_physics.diagnosis.rollout_numbers import REFERENCE_DELAY, adjustables
from reference_model.acting import JointForces, Signals
from reference_model.control import Goal, command, drive, has_integral, sample_time
from reference_model.effects.base import BodyEffect, JointSignals, SensorEffect, SensorSignals
from reference_model.effects.catalogue import UsedEffect, used_effects
from reference_model.effects.scan import Scan
from reference_model.effects.stepping import step
from reference_model.inertial import BODY_NUMBERS, inertial_names, nominal_inertial
from reference_model.symbolic import Motion, SymbolicRobot
from robot_model import InputError, NoController, Robot, VoltageServo

__all__ = ["ClosedLoop", "Row"]

#: A direction s is handed to the laws through the transition speed: tanh(SURE s) is s to rounding.
SURE = 40.0
#: Stands for standstill where laws divide by the speed [rad/s or m/s]; no encoder sees it.
STANDSTILL = 1e-30
#: Newton passes: three decide the direction of one joint, one polishes, one more for each further joint
#: and for internal states such as bristles.
PASSES = 4


@dataclass(frozen=True)
class Row:
    """What a free run is told at one instant, all columns.

    Attributes:
        time: [s].
        reference, rate, acceleration: of the controller's reference, n x 1.
        temperature: of the joints [K], n x 1.
        on: 1 where the drive is switched on, else 0: then the winding is open.
        supply: supply voltage as a multiple of the controller's.
        tick: 1 where a sampled controller acts.
    """

    time: ca.SX
    reference: ca.SX
    rate: ca.SX
    acceleration: ca.SX
    temperature: ca.SX
    on: ca.SX
    supply: ca.SX
    tick: ca.SX

    @classmethod
    def size(cls, joints: int) -> int:
        """Number of entries of a row."""
        return 4 * joints + 4

    @classmethod
    def of(cls, column: ca.SX, joints: int) -> Row:
        """The parts of a column."""
        n = joints
        parts = ca.vertsplit(column, [0, 1, 1 + n, 1 + 2 * n, 1 + 3 * n, 1 + 4 * n, 2 + 4 * n, 3 + 4 * n, 4 + 4 * n])
        return cls(*parts)


class _Forces(JointForces):
    """The robot's effects, for sliding in given directions and at recorded temperatures."""

    direction: ca.SX
    temperature: ca.SX

    def _view(self, signals: Signals, k: int, friction: ca.SX) -> JointSignals:
        speed = signals.velocity[k]
        return replace(
            super()._view(signals, k, friction),
            temperature=self.temperature[k],
            transition=speed * self.direction[k] / SURE,
        )


class ClosedLoop:
    """The compiled free run of one robot structure; its numbers are arguments.

    Args:
        robot: fixed base; its controller is simulated.
        free: names of the numbers by which free runs are differentiated.

    Attributes:
        names: of all numbers, in the order of `constants`.
        size: rows of the state [q; v; states of the effects; integral; held command; largest error].
        run: chain of steps of the state.
        sensitivities: the same with the derivatives by `free` below the state, column by column.
        first: (q, v, row, constants) -> state and derivatives at the first instant.
        output: (state, row, constants) -> [measured positions; actuator torques].
        output_slope: (state and derivatives, row, constants) -> derivatives of the measured positions by
            `free`, n x F column by column.

    Raises:
        InputError: a free base, or a number that the robot does not have.
    """

    def __init__(self, robot: Robot, free: tuple[str, ...] = ()) -> None:
        if robot.base.kind == "free":
            raise InputError(f"robot '{robot.name}' floats; free runs are made for robots with a fixed base.")
        self.robot = robot
        self.names = tuple(adjustables(robot))
        missing = [name for name in free if name not in self.names]
        if missing:
            raise InputError(f"robot '{robot.name}' has no number '{missing[0]}' that could be free.")
        self.free = free
        self._symbols = {name: ca.SX.sym(name) for name in self.names}
        self.constants = ca.vertcat(*self._symbols.values())
        self._free = ca.vertcat(*(self._symbols[name] for name in free)) if free else ca.SX(0, 1)
        self.joints = len(robot.moving_joints)
        self._used = tuple(self._with_symbols(used) for used in used_effects(robot))
        self.forces = _Forces(robot, self._used)
        self._held = sample_time(robot) > 0
        self._split = self._sizes()
        self.size = self._split[-1]
        self._build()

    def _with_symbols(self, used: UsedEffect) -> UsedEffect:
        start = f"{used.effect.id}@{used.at}."
        return replace(
            used, parameters=MappingProxyType({k: self._symbols[start + k] for k in used.parameters})
        )

    def _sizes(self) -> list[int]:
        n = self.joints
        sizes = [n, n, self.forces.states, n if has_integral(self.robot) else 0, n if self._held else 0, 1]
        ends = [0]
        for size in sizes:
            ends.append(ends[-1] + size)
        return ends

    def _inertial(self) -> ca.SX:
        """True mass properties, body effects included, P x 1."""
        names = inertial_names(self.robot)
        numbers = ca.vertcat(*(self._symbols[name] for name in names))
        for used in self._used:
            if not isinstance(used.effect, BodyEffect):
                continue
            terms = used.effect.terms(used.parameters)
            numbers[-3:] += terms.gravity
            if f"{used.at}.mass" in names:
                start = names.index(f"{used.at}.mass")
                pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
                inertia = ca.SX(terms.inertia)
                ten = ca.vertcat(terms.mass, terms.first_moment, *(inertia[pair] for pair in pairs))
                numbers[start : start + len(BODY_NUMBERS)] += ten
        return numbers

    def _motion(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Motion:
        return Motion(q, v, a, **SymbolicRobot.still_base(self.robot))

    def _command(self, row: Row, q: ca.SX, v: ca.SX, integral: ca.SX) -> ca.SX:
        """The controller's command, n x 1; the delay of its reference counts to first order."""
        late = self._symbols[REFERENCE_DELAY]
        reference = row.reference - late * row.rate
        servo = self.robot.controller
        if isinstance(servo, VoltageServo):
            gain = ca.vertcat(*(self._symbols[f"controller.gain.{j.name}"] for j in self.robot.moving_joints))
            duty = ca.fmax(-1, ca.fmin(1, gain * (reference - q)))
            return self._symbols["controller.supply"] * row.supply * duty
        goal = Goal(reference, row.rate - late * row.acceleration, row.acceleration, integral)
        still = ca.SX(self.joints, 1)
        return command(self.robot, self._motion(q, v, still), goal, nominal_inertial(self.robot))

    def _torque(self, row: Row, commanded: ca.SX, v: ca.SX) -> ca.SX:
        """Actuator torque at the joints, n x 1; none where the drive is off."""
        if not isinstance(self.robot.controller, VoltageServo):
            return row.on * drive(self.robot, commanded, v)
        torques = []
        for k, joint in enumerate(self.robot.moving_joints):
            motor = joint.actuator
            if motor is None:
                torques.append(ca.SX(0.0))
                continue
            if motor.torque_constant is None or motor.resistance is None:
                raise InputError(
                    f"robot '{self.robot.name}', joint '{joint.name}': a voltage servo needs the actuator's "
                    "torque_constant and resistance."
                )
            constant = motor.gear_ratio * self._symbols[f"{joint.name}.torque_constant"]
            torque = constant * (commanded[k] - constant * v[k]) / self._symbols[f"{joint.name}.resistance"]
            limit = motor.torque_limit
            torques.append(torque if limit is None else ca.fmax(-limit, ca.fmin(limit, torque)))
        return row.on * ca.vertcat(*torques)

    def _parts(self, state: ca.SX) -> list[ca.SX]:
        return list(ca.vertsplit(state, self._split))

    def _build(self) -> None:
        state = ca.SX.sym("x", self.size)
        begin, end = (ca.SX.sym(name, Row.size(self.joints)) for name in ("begin", "end"))
        after, new = ca.SX.sym("v+", self.joints), None
        problem = _StepProblem(self, state, begin, end, after)
        solved, modes, error = problem.solve()
        arguments = [state, begin, end, self.constants]
        result = ca.Function("end", [*arguments, after], [problem.end_state(error=ca.SX.sym("e"))[0]]) if new else None
        del result
        follow = problem.end_function()
        x = follow(*arguments, solved, error)
        self.run = Scan(ca.Function("step", arguments, [ca.densify(x)], {"cse": True}))
        sensitivity = ca.SX.sym("S", self.size, len(self.free))
        slope = problem.slope_function()(*arguments, solved, modes, sensitivity)
        both = ca.vertcat(state, ca.vec(sensitivity))
        chain = ca.densify(ca.vertcat(x, ca.vec(slope)))
        stepped = ca.Function("both", [both, begin, end, self.constants], [chain], {"cse": True})
        self.sensitivities = Scan(stepped) if self.free else self.run
        self._build_first()
        self._build_output()
