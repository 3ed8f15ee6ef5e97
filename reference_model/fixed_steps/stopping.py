"""Fixed steps with friction that tries to stop the joints, within its level.

Breedveld, Diepenbroek, van Lunteren, Real-time simulation of friction in a flexible space manipulator, 8th
Int. Conf. Advanced Robotics (ICAR 1997): friction takes the value that brings the velocity to zero within
the step, or its level where that is less. Nothing is smoothed, so that a joint sticks without creep, no step
is stiff, and no event is searched for. For several joints at once, in the form used here (this project's
own, since the original's equations could not be read), the friction T of a step of length h obeys

    T(1) <= T <= T(-1);   T between:  qd + h qdd = 0;   T = T(m):  m (qd + h qdd) >= 0,   m = 1 or -1,

T(m) the force of the joint's effects while it slides in the direction m. A stopping joint is decelerated
evenly over the step, qdd = -qd/h, and is exactly at rest at its end; a resting one does not move at all.
The mechanism is integrated by the classical method of Runge and Kutta. The instant at which a joint stops or
breaks away is known to within a step, so that the method is of first order there, and of fourth in between.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.batched import Batched, Single
from reference_model.codegen.compiled import compiled
from reference_model.fixed_steps.expression import runge_kutta, unit_quaternions
from reference_model.fixed_steps.realtime import check_finite, multiple
from reference_model.plant.loop import LOOP_TOLERANCE, unsettled
from reference_model.plant.sticking import StickingPlant
from reference_model.steppers.effort import Effort
from reference_model.steppers.integration import Course, symbols
from robot_model import InputError, Robot

__all__ = ["StoppingPlant", "integrate_stopping"]

Array = NDArray[np.float64]

#: Tolerance of a stopping force beyond its bound, relative to 1 + the bound, for rounding.
PAST_THE_BOUND = 1e-10


class StoppingPlant(StickingPlant):
    """A `StickingPlant` whose joints of mode 0 are held at given accelerations.

    The last argument of `rate` and `watch` holds the modes, then those accelerations, 2 n x 1.
    """

    def __init__(self, robot: Robot, *, work: bool = False, losses: bool = False) -> None:
        self._asked = ca.SX.sym("asked", 2 * len(robot.moving_joints))
        super().__init__(robot, work=work, losses=losses, mode=self._asked)

    @property
    def direction(self) -> ca.SX:
        return self._asked[: self._asked.shape[0] // 2]

    @property
    def held(self) -> ca.SX:
        return self._asked[self._asked.shape[0] // 2 :]


def integrate_stopping(
    plant: StoppingPlant,
    reference: ca.Function,
    time: Array,
    *,
    hold: float,
    step: float,
    compile_code: bool = False,
    effort: Effort | None = None,
) -> Course:
    """The course of the closed loop at the instants `time`, even and from 0, in steps of `step`.

    Args:
        plant: the closed loop.
        reference: t -> r, rd, rdd.
        time: output instants [s].
        hold: interval over which a command is held [s]; 0 for a continuous controller.
        step: [s]; divides the output interval and `hold`.
        compile_code: run as compiled C where that is possible.
        effort: to which every evaluation of the equations of motion adds the number of states.

    Raises:
        InputError: the step does not divide the intervals, bristles among the effects, no friction that
            agrees with what it causes, or a motion that leaves the finite numbers.
    """
    robot = plant.robot
    if plant.forces.bristles:
        raise InputError(
            f"robot '{robot.name}', joint '{plant.forces.bristles[0][0]}': bristles have a step of their "
            f"own; "
            "simulate LuGre friction at fixed steps without stiction."
        )
    run = _Run(plant, reference, hold > 0, compile_code, effort or Effort())
    interval = float(time[1] - time[0]) if len(time) > 1 else step
    outputs = multiple(robot, interval, step, "the interval between samples")
    ticks = multiple(robot, hold, step, "the controller's sample_time") if hold > 0 else 1
    state = plant.initial(reference)
    command = np.zeros(plant.commands)
    states, modes, commands = [], [], []
    for number in range(outputs * (len(time) - 1) + 1):
        now = number * step
        if hold > 0 and number % ticks == 0:
            command = run.law(now, state)
        asked = run.decided(now, state, command, step)
        if number % outputs == 0:
            states.append(state)
            modes.append(asked)
            commands.append(command)
        state = run.moved(now, state, command, asked, step)
        check_finite(robot, np.array([now]), state[None])
    shown = np.array(states)
    given = np.array(commands) if hold > 0 else run.commands(time[:, None], shown)
    return Course(time, shown, given, np.array(modes))


class _Run:
    """Functions of a step and the modes of the last one."""

    def __init__(
        self, plant: StoppingPlant, reference: ca.Function, sampled: bool, compile_code: bool, effort: Effort
    ) -> None:
        self._plant, self._effort = plant, effort
        joints = plant.layout.joints
        t, x, kind = symbols(reference, plant.layout.size)
        kept, asked, h = kind.sym("u", plant.commands), kind.sym("asked", 2 * joints), kind.sym("h")

        def command(instant: Any, at: Any) -> Any:
            return kept if sampled else plant.command(instant, at, *reference(instant))

        def rate(instant: Any, at: Any) -> Any:
            return plant.rate(instant, at, reference(instant)[0], command(instant, at), asked)

        later = unit_quaternions(plant.layout, runge_kutta(rate, t, x, h))
        verdict = plant.verdict(t, x, reference(t)[0], command(t, x), asked)
        functions: tuple[ca.Function, ...] = (
            ca.Function("later", [t, x, kept, asked, h], [ca.densify(later)], {"cse": True}),
            ca.Function("verdict", [t, x, kept, asked], list(verdict), {"cse": True}),
        )
        if compile_code:
            functions = compiled(functions).functions
        self._later, self._verdict = map(Single, functions)
        self._law = ca.Function("law", [t, x], [plant.command(t, x, *reference(t))])
        rows = plant.layout.rows("velocity")
        self._speeds, self._mode = slice(rows.start, rows.stop), np.zeros(joints)

    def law(self, now: float, state: Array) -> Array:
        """The controller's command."""
        return np.asarray(self._law(now, state)).ravel()

    def commands(self, time: Array, states: Array) -> Array:
        """The same for all instants."""
        return Batched(self._law)(time, states)[0]

    def moved(self, now: float, state: Array, command: Array, asked: Array, step: float) -> Array:
        """The state after a step."""
        self._effort.states += 4 * len(state)
        return self._later(now, state, command, asked, step)[0][:, 0]

    def decided(self, now: float, state: Array, command: Array, step: float) -> Array:
        """Modes of all joints in the step from `now`, and the accelerations of those that stop, (2 n,)."""
        speed, dry = state[self._speeds], list(self._plant.dry)
        settled = not dry
        for mode in self._trials(speed, dry):
            asked = np.concatenate([mode, -speed / step])
            margin, moved, residual = (p[:, 0] for p in self._verdict(now, state, command, asked))
            self._effort.states += len(state)
            if not residual[0] < LOOP_TOLERANCE:
                continue
            settled = True
            ahead = speed + step * moved
            if all(
                margin[k] >= -PAST_THE_BOUND if mode[k] == 0 else mode[k] * ahead[k] >= -PAST_THE_BOUND
                for k in dry
            ):
                self._mode = mode
                return asked
        robot = self._plant.robot
        raise _disagree(robot, now, dry) if settled else unsettled(robot, now)

    def _trials(self, speed: Array, dry: list[int]) -> Iterator[Array]:
        """Modes to try: those of the last step, all stopping, and then every combination."""
        sliding = np.where(speed < 0, -1.0, 1.0)
        yield self._mode
        for chosen in product((0.0, 1.0, -1.0), repeat=len(dry)):
            mode = sliding.copy()
            mode[dry] = chosen
            yield mode


def _disagree(robot: Robot, now: float, dry: list[int]) -> InputError:
    names = ", ".join(robot.moving_joints[joint].name for joint in dry)
    return InputError(
        f"robot '{robot.name}': at t = {now:.6g} s neither stopping nor sliding of {names} agrees with the "
        "friction it causes; lower the coefficients of load-dependent friction or its arms."
    )
