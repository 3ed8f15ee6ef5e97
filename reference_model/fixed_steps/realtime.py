"""Running a robot at a fixed step: one compiled function, in a user's loop or over a complete motion.

`Stepper` is for a loop in which something else commands the robot: a controller under test, a person, a
machine. `integrate_fixed` runs the robot under its own controller, for `simulate(..., step=...)`. The step is
that of `fixed_step`, whose order is four without effect states and two with them. No error is estimated, so a
suitable step has to be found by halving it.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.batched import Batched, Single
from reference_model.codegen.compiled import compiled
from reference_model.control.motion import reference_function
from reference_model.fixed_steps.expression import fixed_step
from reference_model.plant.closed_loop import Plant
from reference_model.plant.layout import Layout
from reference_model.steppers.held_pieces import SAME_INSTANT
from reference_model.steppers.integration import Course
from robot_model import InputError, Robot

__all__ = ["FixedRun", "Stepper", "check_finite", "integrate_fixed", "multiple"]

Array = NDArray[np.float64]

#: Steps in one call of the chained function: enough that the call overhead is negligible, few enough that the
#: function is built quickly.
BLOCK = 256


class Stepper:
    """A robot that advances one step at a time under external commands.

    Args:
        robot: the description; `command` follows its reference motion, if any.
        compile_code: run as compiled C where that is possible. Compiling takes seconds the first time.

    Attributes:
        layout: the parts of a state (see `Layout.split`).
        commands: rows of a command: joint torques in file order [N m or N] (voltages [V] for a voltage
            servo), after the wrench on the base where the controller holds it.
        note: how the step runs.
    """

    def __init__(self, robot: Robot, *, compile_code: bool = True) -> None:
        self._plant, self._reference = Plant(robot), reference_function(robot)
        self.layout: Layout = self._plant.layout
        self.commands = self._plant.commands
        functions = _step_function(self._plant, self._reference), self._plant.command
        code = compiled(functions) if compile_code else None
        step, law = code.functions if code else functions
        self._step, self._law, self._goal = Single(step), Single(law), Single(self._reference)
        self.note = code.note if code else "CasADi's virtual machine"

    def initial(self) -> Array:
        """The initial state of the description, shape (rows,)."""
        return self._plant.initial(self._reference)

    def command(self, time: float, state: Array) -> Array:
        """The command of the robot's own controller, shape (commands,)."""
        return self._law(time, state, *(column[:, 0] for column in self._goal(time)))[0][:, 0]

    def step(self, time: float, state: Array, command: Array, length: float) -> Array:
        """The state `length` [s] after `time` [s] with the command held between, shape (rows,)."""
        return self._step(np.array([time, length]), state, command)[0][:, 0]


def integrate_fixed(
    plant: Plant,
    reference: ca.Function,
    time: Array,
    *,
    hold: float,
    step: float,
    compile_code: bool = False,
) -> Course:
    """The course of the closed loop at the instants `time`, even and from 0, in steps of `step`.

    Args:
        plant: the closed loop.
        reference: t -> r, rd, rdd.
        time: output instants [s].
        hold: interval over which a command is held [s]; 0 for a continuous controller, whose law then holds
            inside the steps too.
        step: [s]; divides the output interval and `hold`.
        compile_code: run as compiled C where that is possible.

    Raises:
        InputError: the step does not divide the intervals, or the motion leaves the finite numbers.
    """
    run = FixedRun(plant, reference, hold=hold, compile_code=compile_code)
    states, commands = run(time, step)
    if hold > 0:
        return Course(time, states, commands)
    t, x = ca.MX.sym("t"), ca.MX.sym("x", plant.layout.size)
    law = ca.Function("law", [t, x], [plant.command(t, x, *reference(t))])
    return Course(time, states, Batched(law)(time[:, None], states)[0])


class FixedRun:
    """A closed loop, prepared for repeated runs at fixed steps.

    Args:
        plant, reference, hold, compile_code: as of `integrate_fixed`.
    """

    def __init__(
        self, plant: Plant, reference: ca.Function, *, hold: float, compile_code: bool = False
    ) -> None:
        advance = _closed_step(plant, reference, held=hold > 0)
        if compile_code:
            (advance,) = compiled([advance]).functions
        self._plant, self._hold, self._march = plant, hold, advance.mapaccum(BLOCK)
        self._start = np.concatenate([plant.initial(reference), np.zeros(plant.commands)])

    def __call__(self, time: Array, step: float) -> tuple[Array, Array]:
        """States, and commands in force from each instant on where they are held, both shape (N, rows).

        Args:
            time: output instants [s], even and from 0.
            step: [s]; divides the output interval and `hold`.

        Raises:
            InputError: the step does not divide the intervals, or the motion leaves the finite numbers.
        """
        robot, size = self._plant.robot, self._plant.layout.size
        interval = float(time[1] - time[0]) if len(time) > 1 else step
        outputs = multiple(robot, interval, step, "the interval between samples")
        ticks = multiple(robot, self._hold, step, "the controller's sample_time") if self._hold > 0 else 1
        steps = outputs * (len(time) - 1) + 1  # one more, in which the last command is found
        number = np.arange(-(-steps // BLOCK) * BLOCK)
        spans = np.column_stack([number * step, np.full(len(number), step), number % ticks == 0])
        now = self._start
        found = [now[None]]
        for start in range(0, len(number), BLOCK):
            found.append(self._march(now, spans[start : start + BLOCK].T).full().T)
            now = found[-1][-1]
        every = np.vstack(found)
        states = every[: steps + 1 : outputs, :size][: len(time)]
        check_finite(robot, time, states)
        return states, every[1 : steps + 1 : outputs, size:]


def _kind(reference: ca.Function) -> Any:
    return ca.SX if reference.is_a("SXFunction") else ca.MX


def _step_function(plant: Plant, reference: ca.Function) -> ca.Function:
    """[time; length], state, command held over the step -> state after it."""
    kind = _kind(reference)
    span, state = kind.sym("span", 2), kind.sym("x", plant.layout.size)
    held = kind.sym("u", plant.commands)
    later = fixed_step(
        plant,
        time=span[0],
        state=state,
        length=span[1],
        goal=lambda instant: reference(instant)[0],
        command=lambda instant, at: held,
    )
    return ca.Function("forward_step", [span, state, held], [ca.densify(later)], {"cse": True})


def _closed_step(plant: Plant, reference: ca.Function, *, held: bool) -> ca.Function:
    """[state; command], [time; length; whether the controller acts] -> the same after a step."""
    kind = _kind(reference)
    before, span = kind.sym("x", plant.layout.size + plant.commands), kind.sym("span", 3)
    state, kept = before[: plant.layout.size], before[plant.layout.size :]

    def law(instant: Any, at: Any) -> Any:
        return plant.command(instant, at, *reference(instant))

    command = ca.if_else(span[2], law(span[0], state), kept) if held else kept
    later = fixed_step(
        plant,
        time=span[0],
        state=state,
        length=span[1],
        goal=lambda instant: reference(instant)[0],
        command=(lambda instant, at: command) if held else law,
    )
    after = ca.densify(ca.vertcat(later, command))
    return ca.Function("closed_step", [before, span], [after], {"cse": True})


def multiple(robot: Robot, interval: float, step: float, what: str) -> int:
    """How many steps an interval [s] is; raises `InputError` when that is no whole number."""
    if not step > 0:
        raise InputError(f"robot '{robot.name}': a step of {step:g} s; give one above zero.")
    count = round(interval / step)
    if count < 1 or abs(count * step - interval) > SAME_INSTANT * interval * max(count, 1):
        raise InputError(
            f"robot '{robot.name}': a step of {step:g} s does not divide {what}, {interval:g} s; "
            f"take {interval / max(1, count):.6g} s."
        )
    return count


def check_finite(robot: Robot, time: Array, states: Array) -> None:
    """Raise `InputError` where states, shape (N, rows), are not finite, with the last sound instant."""
    sound = np.isfinite(states).all(axis=1)
    if not sound.all():
        raise InputError(
            f"robot '{robot.name}': with this step the motion leaves the finite numbers after "
            f"t = {time[max(0, int(np.argmin(sound)) - 1)]:.6g} s; take a shorter step, or none."
        )
