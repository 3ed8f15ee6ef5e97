"""Motions in Exudyn without Python and in the reference model, at about the same error; a round is one run.

    make bench ARGS="-k exudyn"

`python -m benchmarks.work_precision.study` compares at equal error, over steps and tolerances.
"""

from __future__ import annotations

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

pytest.importorskip("mujoco", reason="needs the extra [peers]")

from benchmarks.native import Setting
from benchmarks.work_precision.manoeuvres import CASES
from benchmarks.work_precision.rivals import NativeTrial, Trial, own_trials
from benchmarks.work_precision.truth import Truth
from reference_model.compiled import compiler

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler on the path")

ROUNDS = 7
#: Exudyn's method and steps for every motion, and our tolerance whose error is below that of those.
PAIRS = {
    "arm, swinging": (Setting("RK44", steps=200), "explicit, order 8", 1e-6),
    "arm, tracking": (Setting("RK44", steps=1000), "explicit, order 8", 3e-6),
    "space arm, joint control": (Setting("RK44", steps=500), "explicit, order 8", 1e-5),
    "flexible": (Setting("generalised alpha", steps=2000), "explicit, order 8", 1e-5),
    "flexible, Stribeck": (Setting("generalised alpha", steps=2000), "CVODES", 1e-6),
}


def timed(benchmark: BenchmarkFixture, motion: str, trial: Trial, truth: Truth) -> None:
    benchmark.group = f"motion: {motion}"
    found: list[float] = []
    benchmark.pedantic(lambda: found.append(trial.timed()), rounds=ROUNDS, warmup_rounds=1)
    benchmark.extra_info["seconds"] = float(np.median(found))
    benchmark.extra_info["error"] = truth.error(trial.course())


@pytest.mark.parametrize("motion", PAIRS)
def test_reference_model(benchmark: BenchmarkFixture, motion: str) -> None:
    case, (_, method, tolerance) = CASES[motion], PAIRS[motion]
    truth = Truth(case)
    benchmark.extra_info["ours"] = True
    timed(benchmark, motion, own_trials(case, truth, method, (tolerance,))[0], truth)


@pytest.mark.parametrize("motion", PAIRS)
def test_exudyn(benchmark: BenchmarkFixture, motion: str) -> None:
    case, (setting, _, _) = CASES[motion], PAIRS[motion]
    benchmark.extra_info["peer"] = f"Exudyn {setting.method}, {setting.steps} steps"
    timed(benchmark, motion, NativeTrial(case, setting), Truth(case))
