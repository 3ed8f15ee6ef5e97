"""One step of a closed loop with dry friction that really sticks, as one CasADi expression.

Implicit midpoint in the smooth part; dry friction is set-valued and decided by the velocity at the end of
the step (Moreau's time stepping; Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems,
2008, ch. 10). A joint that sticks has velocity exactly zero, so that it neither creeps nor chatters however
long the step; between stick and slip the step is of second order.

With g the excess of what the motion needs over what acts, ``g = inverse dynamics - actuator torque -
effects``, evaluated for sliding forwards and backwards, every joint has to fulfil one of

    v+ > 0 and g_forwards = 0,    v+ < 0 and g_backwards = 0,    v+ = 0 and g_forwards >= 0 >= g_backwards.

A semismooth Newton method finds it: directions are revised between its passes. In most steps every joint
slides on; then few passes with the directions as they are do, and whether they did is checked step by step.
Derivatives follow from the implicit function theorem at the solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from missing_physics.diagnosis.free_run.model import LoopModel, Row, State
from reference_model.effects.scan import Scan
from reference_model.effects.stepping import step
from reference_model.plant.acting import Signals
from robot_model import InputError, Robot, nearest

__all__ = ["ClosedLoop"]

#: Newton passes: up to three find the direction of one joint, one polishes; each internal state may need one
#: more, each further joint a stop, a solution with it stopped and a start.
PASSES = 4
PASSES_PER_JOINT = 3
#: Newton passes of a step in which every joint slides on as before, and the last one's correction with which
#: it counts as solved, over the fastest joint: convergence is quadratic.
EASY_PASSES, EASY_CHANGE = 3, 1e-9


@dataclass(frozen=True)
class _End:
    """The end of a step, for velocities `after` and directions that are given.

    Attributes:
        excess: g, n x 1.
        state: at the end.
    """

    excess: ca.SX
    state: State


class ClosedLoop:
    """The compiled free run of one robot; its numbers are arguments.

    Args:
        robot: with a fixed base; its controller is simulated.
        free: names of the numbers by which the run is differentiated.

    Attributes:
        model: the expressions behind it.
        free: as given.
        size: rows of a state.
        run: chain of steps of the state along rows, `Scan`.
        sensitivities: the same with the derivatives by `free` below the state, column by column.
        first: (q, v, row, constants) -> state at the first instant and its derivatives.
        output: (state, row, constants) -> [measured positions; actuator torques], 2n x 1.
        slope: (state and derivatives, row, constants) -> derivatives of the measured positions, column by
            column.

    Raises:
        InputError: a free base, or a number that the robot does not have.
    """

    def __init__(self, robot: Robot, free: tuple[str, ...] = ()) -> None:
        self.model = LoopModel(robot)
        for name in free:
            if name not in self.model.symbols:
                raise InputError(
                    f"robot '{robot.name}' has no number '{name}'{nearest(name, self.model.symbols)}."
                )
        self.free = free
        self.size = sum(self.model.sizes)
        self._numbers = ca.vertcat(ca.SX(0, 1), *(self.model.symbols[name] for name in free))
        n, rows = self.model.joints, Row.ends(self.model.joints)[-1]
        self._state = ca.SX.sym("x", self.size)
        self._begin, self._stop = ca.SX.sym("begin", rows), ca.SX.sym("end", rows)
        self._after, self._direction = ca.SX.sym("after", n), ca.SX.sym("direction", n)
        self._known = [self._state, self._begin, self._stop, self.model.constants]
        self._sensitivity = ca.SX.sym("S", self.size, len(free))
        self._both = ca.vertcat(self._state, ca.vec(self._sensitivity))
        end = self._end()
        self._compile_steps(end)
        self._compile_ends()

    def _function(self, name: str, inputs: list[ca.SX], *outputs: ca.SX) -> ca.Function:
        return ca.Function(name, inputs, [ca.densify(output) for output in outputs], {"cse": True})

    def _end(self) -> _End:
        """What the step leads to with `_after` and `_direction`."""
        model, now = self.model, self.model.state(self._state)
        begin, stop = Row.of(self._begin, model.joints), Row.of(self._stop, model.joints)
        duration = stop.time - begin.time
        mid = Row.of((self._begin + self._stop) / 2, model.joints)
        mid = Row(**{**vars(mid), "on": begin.on, "tick": begin.tick})
        v = (now.velocity + self._after) / 2
        q = now.position + duration / 2 * v
        a = (self._after - now.velocity) / duration
        error = mid.reference - q
        integral = now.integral + duration * error if now.integral.shape[0] else now.integral
        if model.sampled:
            fresh = model.command(begin, now.position, now.velocity, now.integral)
            held = ca.if_else(begin.tick > 0.5, fresh, now.held)
            commanded = held
        else:
            held, commanded = now.held, model.command(mid, q, v, (now.integral + integral) / 2)
        torque = model.torque(mid, commanded, v)
        robot = model.mechanism(q, v, a)
        signals = Signals(mid.time, q, v, a, torque, robot.bearing_loads(robot.joint_wrenches))
        effects = now.effects
        if effects.shape[0]:
            z = ca.SX.sym("z", effects.shape[0])
            rate = ca.Function(
                "rate", [z, *self._step_inputs()], [model.act(mid, signals, z, self._direction)[1]]
            )
            inputs = self._step_inputs()
            effects = step(
                lambda states, _: rate(states, *inputs), effects, self._begin, self._stop, duration
            )
        force, _ = model.act(mid, signals, (now.effects + effects) / 2, self._direction)
        return _End(
            robot.inverse_dynamics - torque - force,
            State(now.position + duration * v, self._after, effects, integral, held, now.worst),
        )

    def _step_inputs(self) -> list[ca.SX]:
        return [*self._known, self._after, self._direction]

    def _excess(self, end: _End) -> ca.Function:
        """(velocities after, directions, *known) -> excess, and its derivatives by the velocities."""
        given = [self._after, self._direction, *self._known]
        return self._function("excess", given, end.excess, ca.jacobian(end.excess, self._after))

    def _solve(self, end: _End) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Velocities at the end, directions (0 where a joint sticks), and the last pass's correction."""
        excess, n = self._excess(end), self.model.joints
        ones = ca.SX.ones(n)
        after = self.model.state(self._state).velocity
        mode, change = ca.sign(after), ca.SX.zeros(n)
        # With several joints, whether one breaks loose is asked only where the others' velocities solve the
        # equations with it at rest; else directions could alternate for ever.
        solved = ca.SX(1 if n == 1 else 0)
        for _ in range(PASSES + PASSES_PER_JOINT * (n - 1) + self.model.sizes[2]):
            forwards, backwards = (_pair(excess(after, sign * ones, *self._known)) for sign in (1, -1))
            leaving = ca.if_else(forwards[0] < 0, 1, ca.if_else(backwards[0] > 0, -1, 0))
            mode = ca.if_else(mode == 0, solved * leaving, mode)
            gap, matrix = _selected(mode, after, forwards, backwards)
            moved = after - ca.solve(matrix, gap)
            wrong = moved * mode <= 0
            stopped = ca.mmax(ca.if_else(mode == 0, 0, wrong))
            moved, mode = ca.if_else(wrong, 0, moved), ca.if_else(wrong, 0, mode)
            solved = ca.SX(1) if n == 1 else 1 - stopped
            change, after = moved - after, moved
        return after, mode, ca.mmax(ca.fabs(change))

    def _slide(self, end: _End) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """`_solve` where every joint slides on as before, and 1 where that is so."""
        excess = self._excess(end)
        start = after = self.model.state(self._state).velocity
        mode = ca.sign(start)
        holds, change = ca.SX(1), ca.SX.zeros(self.model.joints)
        for _ in range(EASY_PASSES):
            gap, matrix = _pair(excess(after, mode, *self._known))
            moved = after - ca.solve(matrix, gap)
            holds *= ca.mmin(moved * mode > 0)
            change, after = moved - after, moved
        worst = ca.mmax(ca.fabs(change))
        fastest = ca.fmax(ca.mmax(ca.fabs(start)), ca.mmax(ca.fabs(after)))
        return after, mode, worst, holds * (worst <= EASY_CHANGE * fastest)

    def _compile_steps(self, end: _End) -> None:
        final = self._function("final", self._step_inputs(), end.state.column)
        *easy, holds = self._slide(end)
        solutions = [self._solve(end), tuple(easy)]
        advanced = []
        for after, mode, change in solutions:
            # A joint that sticks has no direction; its effects' states go on as at rest, so either will do.
            state = final(*self._known, after, ca.if_else(mode < 0, -1, 1))
            state[-1] = ca.fmax(state[-1], change)
            advanced.append(state)
        self.run = self._scan(self._known, advanced, holds)
        if not self.free:
            return
        slope = self._slope(end)
        for k, (after, mode, _) in enumerate(solutions):
            turned = slope(*self._known, after, mode, self._sensitivity)
            advanced[k] = ca.vertcat(advanced[k], ca.vec(turned))
        self.sensitivities = self._scan([self._both, *self._known[1:]], advanced, holds)

    def _scan(self, inputs: list[ca.SX], advanced: list[ca.SX], holds: ca.SX) -> Scan:
        sure = self._function("step", inputs, advanced[0])
        return Scan(sure, self._function("easy", inputs, advanced[1], holds))

    def _slope(self, end: _End) -> ca.Function:
        """Derivatives of the state at the end, by the implicit function theorem."""
        mode = ca.SX.sym("mode", self.model.joints)
        direction = ca.if_else(mode < 0, -1, 1)
        gap, column = ca.substitute([end.excess, end.state.column], [self._direction], [direction])
        gap = ca.if_else(mode == 0, self._after, gap)

        def along(value: ca.SX) -> ca.SX:
            by_state = ca.jacobian(value, self._state) @ self._sensitivity
            return by_state + ca.jacobian(value, self._numbers)

        turned = -ca.solve(ca.densify(ca.jacobian(gap, self._after)), ca.densify(along(gap)))
        total = along(column) + ca.jacobian(column, self._after) @ turned
        return self._function("slope", [*self._known, self._after, mode, self._sensitivity], total)

    def _compile_ends(self) -> None:
        model = self.model
        q, v = (ca.SX.sym(name, model.joints) for name in "qv")
        column = ca.SX.sym("row", self._begin.shape[0])
        row = Row.of(column, model.joints)
        zero = [ca.SX.zeros(size) for size in model.sizes]
        start = State(q, v, model.settled(row, q, v), zero[3], zero[4], zero[5]).column
        slopes = ca.jacobian(start, self._numbers)
        inputs = [q, v, column, model.constants]
        self.first = self._function("first", inputs, ca.vertcat(start, ca.vec(ca.densify(slopes))))
        now = model.state(self._state)
        said = model.measured(row, now.position, now.velocity)
        wish = model.command(row, now.position, now.velocity, now.integral)
        torque = model.torque(row, now.held if model.sampled else wish, now.velocity)
        constants = model.constants
        self.output = self._function("output", [self._state, column, constants], ca.vertcat(said, torque))
        slope = ca.jacobian(said, self._state) @ self._sensitivity + ca.jacobian(said, self._numbers)
        self.slope = self._function("slopes", [self._both, column, constants], ca.vec(slope))


def _pair(outputs: Any) -> tuple[ca.SX, ca.SX]:
    return outputs[0], outputs[1]


def _selected(
    mode: ca.SX, after: ca.SX, forwards: tuple[ca.SX, ca.SX], backwards: tuple[ca.SX, ca.SX]
) -> tuple[ca.SX, ca.SX]:
    """The equations in force and their matrix: those of sliding, or that the velocity is zero."""
    n = mode.shape[0]
    gaps, rows = [], []
    for i in range(n):
        ahead = mode[i] > 0
        gap = ca.if_else(ahead, forwards[0][i], backwards[0][i])
        row = ca.if_else(ahead, forwards[1][i, :], backwards[1][i, :])
        gaps.append(ca.if_else(mode[i] == 0, after[i], gap))
        rows.append(ca.if_else(mode[i] == 0, ca.SX.eye(n)[i, :], row))
    return ca.vertcat(*gaps), ca.densify(ca.vertcat(*rows))
