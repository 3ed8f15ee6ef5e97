"""Motions in Exudyn without Python functions and in the reference model, at about the same error.

    make bench ARGS="-k exudyn"

Each engine has the method that was the fastest at that error in `python -m benchmarks.work_precision.study`,
which compares over steps and tolerances. A round is one run; making it ready is not in it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

pytest.importorskip("mujoco", reason="needs the extra [peers]")

from benchmarks.native import Setting
from benchmarks.work_precision.manoeuvres import CASES
from benchmarks.work_precision.rivals import Trial, exudyn_trial, own_trials
from benchmarks.work_precision.truth import Truth
from reference_model.codegen.compiled import compiler

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler on the path")

ROUNDS = 7
#: Exudyn's method and steps for every motion, and our method and the tolerance at which its error is below.
PAIRS = {
    "arm, swinging": (Setting("DOPRI5, tolerance", tolerance=1e-4), "explicit, order 8", 3e-6),
    "arm, tracking": (Setting("trapezoidal, index 2, loose", steps=100), "Rosenbrock", 3e-3),
    "space arm, joint control": (Setting("RK44", steps=500), "explicit, order 8", 3e-6),
    "flexible": (Setting("generalised alpha, loose", steps=500), "Rosenbrock", 1e-4),
    "flexible, Stribeck": (Setting("trapezoidal, index 2, loose", steps=2000), "Rosenbrock", 1e-4),
    # The headline: flexible space robot as shipped, LuGre friction from computed bearing loads.
    "flexible, LuGre": (Setting("trapezoidal, index 2, loose", steps=1000), "Rosenbrock", 7e-5),
}
_TRUTHS: dict[str, Truth] = {}


def truth_of(motion: str) -> Truth:
    """The converged solution, computed once."""
    if motion not in _TRUTHS:
        _TRUTHS[motion] = Truth(CASES[motion])
    return _TRUTHS[motion]


def timed(benchmark: BenchmarkFixture, motion: str, trial: Trial) -> None:
    benchmark.group = f"motion: {motion}"
    found: list[float] = []

    def run(ready: Callable[[], None]) -> None:
        found.append(trial.run_ready(ready))

    benchmark.pedantic(run, setup=lambda: ((trial.prepare(),), {}), rounds=ROUNDS, warmup_rounds=1)
    benchmark.extra_info["seconds"] = float(np.median(found))
    benchmark.extra_info["error"] = truth_of(motion).error(trial.course())


@pytest.mark.parametrize("motion", PAIRS)
def test_reference_model(benchmark: BenchmarkFixture, motion: str) -> None:
    _, method, tolerance = PAIRS[motion]
    benchmark.extra_info["ours"] = True
    timed(benchmark, motion, own_trials(CASES[motion], truth_of(motion), method, (tolerance,))[0])


@pytest.mark.parametrize("motion", PAIRS)
def test_exudyn(benchmark: BenchmarkFixture, motion: str) -> None:
    setting = PAIRS[motion][0]
    step = f"{setting.steps} steps" if setting.steps else f"tolerance {setting.tolerance:g}"
    benchmark.extra_info["peer"] = f"Exudyn {setting.method}, {step}"
    timed(benchmark, motion, exudyn_trial(CASES[motion], setting))
