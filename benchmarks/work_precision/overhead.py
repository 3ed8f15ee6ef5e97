"""Overhead of runs of the reference model over evaluating the equations, for rigid robots."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from benchmarks.evidence import paragraph, percent, table
from benchmarks.speed.loops import own_loop
from benchmarks.work_precision.manoeuvres import CASES, Case
from benchmarks.work_precision.truth import closed_loop
from reference_model.steppers.explicit_run import ExplicitRun
from reference_model.steppers.rosenbrock_run import RosenbrockRun

__all__ = ["overhead_part"]

Array = NDArray[np.float64]

#: Relative tolerance of the runs.
LOOSE = 1e-2
#: Runs whose minimum time is used, evaluations of a loop, and loops.
REPEATS, EVALUATIONS, LOOPS = 20, 5_000, 5


def overhead_part() -> str:
    """The section of the page."""
    rows = []
    for case in (case for case in CASES.values() if not case.flexible):
        print(f"{case.name}: cost of a step", file=sys.stderr, flush=True)
        plant, reference, _ = closed_loop(case.robot)
        runs = [] if case.stiff else [("explicit, order 8", ExplicitRun(plant, reference))]
        runs.append(("Rosenbrock", RosenbrockRun(plant, reference)))
        rows += [_row(case, name, run) for name, run in runs]
    headings = [
        "motion",
        "by",
        "steps:",
        "evaluations:",
        "run [us]:",
        "equations:",
        "their derivative:",
        "rest:",
    ]
    return "\n\n".join(
        [
            "## What a step of a rigid robot costs besides its equations",
            paragraph(
                f"Runs at a relative tolerance of {LOOSE:g}; the share of their time that evaluations of",
                "the equations and of their derivative take, each timed alone in a compiled loop along",
                "the motion. The rest is the integrator, its linear equations, interpolation, and the",
                "call from Python (some microseconds).",
            ),
            table(headings, rows),
            paragraph(
                "What was tried to make it less. Kept: arguments of the compiled code made ready once,",
                "and arrays handed over in buffers whose addresses are known; the explicit method's",
                "coefficients as constants in its code; linear equations of the Rosenbrock methods with",
                "positions eliminated first and the rest inverted, where before a factorisation with row",
                "exchanges filled what was empty and each solution waited for as many divisions as there",
                "are states; equations and derivatives of up to 25,000 operations compiled in one piece",
                "for the processor at hand. Tried and left: order 4 instead of 5 of the Rosenbrock",
                "methods below a tolerance of 0.01, which takes longer at the same error. What is left at",
                "loose tolerances is evaluating the equations: steps of explicit methods are as short as",
                "the control's damping lets them be stable, and those of Rosenbrock methods carry a",
                "derivative of all equations each.",
            ),
        ]
    )


def _row(case: Case, name: str, run: ExplicitRun | RosenbrockRun) -> list[str]:
    def once() -> Array:
        return run(case.instants, rtol=LOOSE, atol=1e-2 * LOOSE)

    states = once()
    whole = _least(lambda: _timed(once), REPEATS)
    columns = [case.instants[:, None], states]
    equations = run.evaluations * _cost(run.functions[0], columns)
    derivative = 0.0
    if isinstance(run, RosenbrockRun):
        unknown = np.array([run.functions[0](*row)[1].full().ravel() for row in zip(case.instants, states)])
        derivative = run.derivatives * _cost(run.functions[1], [*columns, unknown])
    shares = [equations / whole, derivative / whole]
    counts = [str(run.steps), str(run.evaluations), f"{1e6 * whole:.3g}"]
    return [case.name, name, *counts, *(percent(s, 0) for s in (*shares, max(0.0, 1 - sum(shares))))]


def _cost(function: ca.Function, columns: Sequence[Any]) -> float:
    """An evaluation [s], the least of some loops."""
    return _least(own_loop(function, columns, evaluations=EVALUATIONS, tuned=True), LOOPS)


def _least(measure: Callable[[], float], count: int) -> float:
    return min(measure() for _ in range(count))


def _timed(run: Callable[[], object]) -> float:
    import time

    start = time.perf_counter()
    run()
    return time.perf_counter() - start
