"""The closed loop integrated by linearly implicit steps, all of it compiled C: stable however stiff.

Bristles, tight control and vibrating links are stiff: explicit steps are then limited by stability, and the
overhead of CVODES, a multistep method with many steps, exceeds the cost of the equations of a few bodies. A
Rosenbrock method takes a few long steps, each with one derivative of the equations, one factorisation and no
iteration (`rosenbrock.c`). For stiff friction or control it is the fastest of our integrators down to errors
of about 1e-7.

The derivative is that of the equations before they are solved (`Plant.implicit`), which needs fewer
operations than the derivative of their solution: a tenth for arms whose friction depends on bearing loads.
"""

from __future__ import annotations

import ctypes
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.compiled import c_library, compiled
from reference_model.plant.closed_loop import Plant
from reference_model.steppers.explicit_run import (
    BLOCK,
    FLAGS,
    REASONS,
    address,
    broken_off,
    continuous_course,
    scratch,
    uncompiled,
)
from reference_model.steppers.integration import MAX_STEPS, Course, symbols
from reference_model.steppers.rosenbrock_tables import RODAS4, RODAS5P, Tables

__all__ = ["COARSE", "RosenbrockRun", "integrate_rosenbrock"]

Array = NDArray[np.float64]


#: From this relative tolerance on the method of order 4 takes less time than that of order 5.
COARSE = 1e-2
#: The method above it and the one below.
METHODS = {"coarse": RODAS4, "fine": RODAS5P}


class RosenbrockRun:
    """A closed loop, prepared for repeated integration.

    Args:
        plant: the closed loop; its controller is continuous.
        reference: t -> r, rd, rdd.

    Attributes:
        steps, evaluations, derivatives, refused: of the last run; the last are rejected steps.
        functions: (t, x) -> rate, unknowns, and (t, x, unknowns) -> derivative, as they are compiled.

    Raises:
        InputError: there is no C compiler.
    """

    def __init__(self, plant: Plant, reference: ca.Function) -> None:
        self._plant, self._reference = plant, reference
        t, x, kind = symbols(reference, plant.layout.size)
        goal = reference(t)
        command, unknown = plant.command(t, x, *goal), kind.sym("unknown", plant.unknowns)
        found = plant.solved()(t, x, goal[0], command)
        rate = ca.Function("closed_solved", [t, x], list(found), {"cse": True})
        balance = ca.vertcat(*plant.implicit()(t, x, goal[0], command, unknown))
        slope = ca.jacobian(balance, ca.vertcat(t, x, unknown))
        slopes = ca.Function("closed_slopes", [t, x, unknown], [slope], {"cse": True})
        self.functions = rate, slopes
        codes = [compiled([function], tuned=True) for function in self.functions]
        self._libraries = []  # kept as long as their functions are called
        for code in codes:
            if code.library is None:
                raise uncompiled(plant, code.note, "Rosenbrock")
            self._libraries.append(ctypes.CDLL(str(code.library)))
        try:
            library = _method(plant.layout.size, plant.layout.positions, plant.unknowns)
        except (OSError, subprocess.SubprocessError) as error:
            raise uncompiled(plant, str(error), "Rosenbrock") from None
        self._method = library.rosenbrock
        self._own = [
            (ctypes.cast(getattr(library, function.name()), ctypes.c_void_p), scratch(function))
            for library, function in zip(self._libraries, self.functions)
        ]
        pattern = slope.sparsity()
        self._pattern = np.array(pattern.row(), dtype=np.int64), np.array(pattern.colind(), dtype=np.int64)
        self._values = np.zeros(max(1, pattern.nnz()))
        # As in `ExplicitRun`: what is the same in every call is made ready once.
        given: list[Any] = []
        for function, (arg, res, iw, w) in self._own:
            given += [function, arg, res, address(iw), address(w)]
        shared = *given, *map(address, (*self._pattern, self._values))
        self._same = {order: (*shared, *_numbers(own)) for order, own in METHODS.items()}
        self._counts, self._step, self._reached = (
            np.zeros(4, dtype=np.int64),
            ctypes.c_double(),
            ctypes.c_double(),
        )
        self._room = np.zeros(library.room_for_rosenbrock())
        self._counters = (
            *(ctypes.byref(self._step), address(self._counts), ctypes.byref(self._reached)),
            address(self._room),
        )
        self._time, self._states = np.zeros(BLOCK + 1), np.zeros((BLOCK + 1, plant.layout.size))
        self._where = address(self._time), address(self._states)
        self._most = ctypes.c_long(MAX_STEPS)
        self._start = plant.initial(reference)
        self.steps = self.evaluations = self.derivatives = self.refused = 0

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
        self._step.value, self._counts[:] = 0.0, 0
        own = self._same["coarse" if rtol >= COARSE else "fine"]
        settings = ctypes.c_double(rtol), ctypes.c_double(atol), ctypes.c_double(longest or np.inf)
        for first in range(0, len(time) - 1, BLOCK):
            rows = slice(first, first + BLOCK + 1)
            self._block(time[rows], states[rows], own, settings)
        self.steps, self.evaluations, self.derivatives, self.refused = self._counts.tolist()
        return states

    def _block(
        self, time: Array, states: Array, same: tuple[Any, ...], settings: tuple[ctypes.c_double, ...]
    ) -> None:
        count = len(time)
        self._time[:count], self._states[0] = time, states[0]
        flag = self._method(*same, count, *self._where, *settings, self._most, *self._counters)
        states[1:] = self._states[1:count]
        if flag:
            raise broken_off(self._plant, self._reference, (time, states), self._reached.value, REASONS[flag])


def _numbers(own: Tables) -> tuple[Any, ...]:
    """A method's tables as the compiled code takes them."""
    return (
        *own.dense.shape[::-1],
        *map(ctypes.c_double, (own.gamma, own.order)),
        *map(address, (own.places, own.shares, own.instants, own.slopes, own.dense)),
    )


def integrate_rosenbrock(
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
    return continuous_course(
        RosenbrockRun, "Rosenbrock", plant, reference, time, hold=hold, rtol=rtol, atol=atol
    )


@cache
def _method(rows: int, positions: int, unknowns: int) -> Any:
    source = (Path(__file__).parent / "rosenbrock.c").read_text(encoding="utf-8")
    sizes = f"-DROWS={rows}", f"-DPOSITIONS={positions}", f"-DUNKNOWNS={unknowns}"
    library = ctypes.CDLL(str(c_library(source, *FLAGS, *sizes)))
    library.room_for_rosenbrock.restype = ctypes.c_long
    return library
