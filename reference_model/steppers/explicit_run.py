"""The closed loop integrated explicitly, all of it compiled C: order 8 with error control and dense output.

For robots without stiff friction explicit steps suffice, and the overhead of an integrator then costs more
than the equations. Here right-hand side and integrator are one piece of machine code (`march.c`), in which a
step of a robot of a few bodies takes some microseconds. Stiffness only costs steps: the error is still
controlled, and the run stops with an error if there are too many steps.

The method is Dormand and Prince's of order 8 with errors of orders 5 and 3 (Hairer, Norsett, Wanner, Solving
Ordinary Differential Equations I, 1993, II.5 and II.6); its coefficients are those of SciPy's `DOP853`.
"""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from reference_model.codegen.batched import Batched
from reference_model.codegen.compiled import c_library, compiled
from reference_model.kernels import rate_by_size
from reference_model.plant.closed_loop import Plant
from reference_model.steppers.integration import LONGEST_STEP, MAX_STEPS, Course, stopped, symbols
from robot_model import InputError

__all__ = [
    "BLOCK",
    "FLAGS",
    "REASONS",
    "ExplicitRun",
    "address",
    "broken_off",
    "continuous_course",
    "integrate_explicit",
    "scratch",
    "uncompiled",
]

Array = NDArray[np.float64]

#: Samples in one call of the compiled code; interrupts are handled in between.
BLOCK = 1024
#: For loops over a state's rows that the compiler turns into vector instructions.
FLAGS = ("-O3",)
#: Error codes of the compiled code.
REASONS = {
    1: f"more than {MAX_STEPS} steps were needed to the next sample",
    2: "no step was small enough for the tolerance",
    3: "the accelerations are not finite",
}


class ExplicitRun:
    """A closed loop, prepared for repeated integration.

    Args:
        plant: the closed loop; its controller is continuous.
        reference: t -> r, rd, rdd.

    Attributes:
        steps, evaluations: of the last run.
        functions: (t, x) -> rate, as it is compiled.

    Raises:
        InputError: there is no C compiler.
    """

    def __init__(self, plant: Plant, reference: ca.Function) -> None:
        self._plant, self._reference = plant, reference
        law = rate_by_size(plant)
        t, x, _ = symbols(reference if law.is_a("SXFunction") else law, plant.layout.size)
        goal = reference(t)
        rate = ca.densify(law(t, x, goal[0], plant.command(t, x, *goal)))
        function = ca.Function("closed_rate", [t, x], [rate], {"cse": True})
        code, self.functions = compiled([function], tuned=True), (function,)
        try:
            self._march = _march(plant.layout.size)
        except (OSError, subprocess.SubprocessError) as error:
            raise uncompiled(plant, str(error), "explicit") from None
        if code.library is None:
            raise uncompiled(plant, code.note, "explicit")
        self._library = ctypes.CDLL(str(code.library))  # kept as long as its function is called
        self._rate = ctypes.cast(self._library.closed_rate, ctypes.c_void_p)
        self._start = plant.initial(reference)
        # A short run takes some ten microseconds in machine code: constant arguments are prepared here, since
        # each pointer made from an array costs two of them.
        arg, res, iw, w = self._kept = scratch(function)
        self._time, self._states = np.zeros(BLOCK + 1), np.zeros((BLOCK + 1, plant.layout.size))
        self._same = (
            *(self._rate, arg, res, address(iw), address(w)),
            *(address(self._time), address(self._states)),
        )
        self._most = ctypes.c_long(MAX_STEPS)
        self._step, self._steps, self._evaluations = ctypes.c_double(), ctypes.c_long(), ctypes.c_long()
        self._reached = ctypes.c_double()
        counted = self._step, self._steps, self._evaluations, self._reached
        self._counts = tuple(ctypes.byref(number) for number in counted)
        self.steps = self.evaluations = 0

    def __call__(self, time: Array, *, rtol: float, atol: float, longest: float | None = None) -> Array:
        """States at the instants `time` [s], which begin at 0, shape (N, rows).

        Args:
            time: rising.
            rtol, atol: of one step.
            longest: step [s]; default is the total time.

        Raises:
            InputError: the integration fails; states when, in which state, and what to try.
        """
        time = np.ascontiguousarray(time, dtype=float)
        states = np.empty((len(time), self._plant.layout.size))
        states[0] = self._start
        self._step.value, self._steps.value, self._evaluations.value = 0.0, 0, 0
        settings = ctypes.c_double(rtol), ctypes.c_double(atol), ctypes.c_double(longest or np.inf)
        for first in range(0, len(time) - 1, BLOCK):
            rows = slice(first, first + BLOCK + 1)
            self._block(time[rows], states[rows], settings)
        self.steps, self.evaluations = self._steps.value, self._evaluations.value
        return states

    def _block(self, time: Array, states: Array, settings: tuple[ctypes.c_double, ...]) -> None:
        count = len(time)
        self._time[:count], self._states[0] = time, states[0]
        flag = self._march(*self._same, count, *settings, self._most, *self._counts)
        states[1:] = self._states[1:count]
        if flag:
            raise broken_off(self._plant, self._reference, (time, states), self._reached.value, REASONS[flag])


def integrate_explicit(
    plant: Plant, reference: ca.Function, time: Array, *, hold: float, rtol: float, atol: float
) -> Course:
    """The course of the closed loop at the instants `time`, which begin at 0.

    Args:
        plant: the closed loop.
        reference: t -> r, rd, rdd.
        time: output instants [s], rising.
        hold: interval over which a command is held [s]; only 0, a continuous controller, is supported.
        rtol, atol: tolerances of a step.

    Raises:
        InputError: the controller is a sampled one, there is no C compiler, or the integration fails.
    """
    return continuous_course(ExplicitRun, "explicit", plant, reference, time, hold=hold, rtol=rtol, atol=atol)


def continuous_course(
    run: Callable[[Plant, ca.Function], Any],
    kind: str,
    plant: Plant,
    reference: ca.Function,
    time: Array,
    *,
    hold: float,
    rtol: float,
    atol: float,
) -> Course:
    """Like `integrate_explicit`, by any integrator for continuous controllers; `kind` is its name."""
    if hold > 0:
        raise InputError(
            f"robot '{plant.robot.name}': the {kind} integrator runs continuous controllers; set "
            'controller.sample_time to 0 or take the integrator "implicit".'
        )
    longest = LONGEST_STEP * float(np.diff(time).min()) if len(time) > 1 else None
    states = run(plant, reference)(time, rtol=rtol, atol=atol, longest=longest)
    t, x, _ = symbols(reference, plant.layout.size)
    law = ca.Function("law", [t, x], [plant.command(t, x, *reference(t))])
    return Course(time, states, Batched(law)(time[:, None], states)[0])


def broken_off(
    plant: Plant, reference: ca.Function, course: tuple[Array, Array], reached: float, reason: str
) -> InputError:
    """Error for a run that stopped at `reached` [s], with the last state before it.

    Args:
        plant: the closed loop.
        reference: t -> r, rd, rdd.
        course: instants, shape (N,), and states, shape (N, x), computed until then.
        reached: the last instant.
        reason: why it stopped.
    """
    time, states = course
    row = max(0, int(np.searchsorted(time, reached, side="right")) - 1)
    known, instant = states[row], float(time[row])
    command = np.asarray(plant.command(instant, known, *reference(instant))).ravel()
    return stopped(plant, instant, known, command, reason)


@cache
def _march(rows: int) -> Any:
    source = _tables() + (Path(__file__).parent / "march.c").read_text(encoding="utf-8")
    return ctypes.CDLL(str(c_library(source, *FLAGS, f"-DROWS={rows}"))).march


def _tables() -> str:
    """In C: stages' weights, with three for the interpolation, instants, result, errors, interpolation."""
    stages, extra = DOP853.A.shape[0], DOP853.A_EXTRA.shape[0]
    weights = np.zeros((stages + 1 + extra, stages + 1 + extra))
    weights[:stages, :stages], weights[stages + 1 :] = DOP853.A, DOP853.A_EXTRA
    instants = np.concatenate([DOP853.C, [1.0], DOP853.C_EXTRA])
    tables = {"A": weights, "C": instants, "B": DOP853.B, "E3": DOP853.E3, "E5": DOP853.E5, "D": DOP853.D}
    return "".join(_constant(name, table) for name, table in tables.items())


def _constant(name: str, table: Array) -> str:
    sizes = "".join(f"[{size}]" for size in table.shape)
    return f"static const double {name}{sizes} = {{{', '.join(map(repr, table.ravel().tolist()))}}};\n"


def scratch(function: ca.Function) -> tuple[Any, ...]:
    """Work space for the pointers and numbers of a generated function."""
    arg = (ctypes.c_void_p * max(2, function.sz_arg()))()
    res = (ctypes.c_void_p * max(1, function.sz_res()))()
    return arg, res, np.zeros(max(1, function.sz_iw()), dtype=np.int64), np.zeros(max(1, function.sz_w()))


def address(array: NDArray[Any]) -> ctypes.c_void_p:
    """Address of an array's first element."""
    return ctypes.c_void_p(array.ctypes.data)


def uncompiled(plant: Plant, why: str, kind: str) -> InputError:
    """Error if an integrator that runs only as compiled C is unavailable."""
    return InputError(
        f"robot '{plant.robot.name}': the {kind} integrator runs as compiled C only ({why}); "
        'take the integrator "implicit".'
    )
