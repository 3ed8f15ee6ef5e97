"""Exudyn without Python runs the motions that the reference model runs: else their times mean nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
#: A short piece of a motion in a process of its own, since the choice of Exudyn's module is for a process.
SCRIPT = """
import sys
from dataclasses import replace
import numpy as np
from benchmarks.exudyn_native import NativeRun, Setting
from benchmarks.manoeuvres import CASES, Course
from benchmarks.rivals import recorded
from reference_model.simulation import simulate
case = CASES[sys.argv[1]]
settings = {"duration": 0.5, "sample_rate": 100.0}
reference = case.robot.reference.model_copy(update=settings)
case = replace(case, robot=case.robot.model_copy(update={"reference": reference}))
run = NativeRun(case, Setting(sys.argv[2], steps=2000))
run()
course = run.course()
ours = recorded(case.robot, simulate(case.robot, sensors=False, rtol=1e-10, atol=1e-12))
print(np.abs(course.values - ours).max() / np.ptp(ours, axis=0).max())
"""


@pytest.mark.parametrize(
    ("motion", "method"),
    [
        ("arm, constant LuGre", "trapezoidal, index 2"),
        ("space arm, joint control", "RK44"),
        ("flexible, Stribeck", "generalised alpha"),
    ],
)
def test_it_is_the_same_motion(motion: str, method: str) -> None:
    command = [sys.executable, "-W", "ignore", "-c", SCRIPT, motion, method]
    told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    # steps of 0.25 ms by second order, over the range of what moves most
    assert float(np.float64(told.stdout.splitlines()[-1])) < 1e-5
