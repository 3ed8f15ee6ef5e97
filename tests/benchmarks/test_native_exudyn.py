"""Exudyn without Python agrees with the reference model, and with compiled functions it agrees with Python
functions: otherwise comparing their times would be meaningless.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from reference_model.codegen.compiled import SWITCH, compiler

ROOT = Path(__file__).resolve().parents[2]
#: A short piece of a motion in a process of its own, since the choice of Exudyn's module is for a process.
SCRIPT = """
import sys
from dataclasses import replace
import numpy as np
from benchmarks.native import CompiledLaws, NativeRun, Setting
from benchmarks.work_precision.manoeuvres import CASES, Course
from benchmarks.work_precision.rivals import recorded
from exudyn_model.simulation import simulate as twin
from reference_model.simulation import simulate
case = CASES[sys.argv[1]]
settings = {"duration": 0.5, "sample_rate": 100.0}
reference = case.robot.reference.model_copy(update=settings)
case = replace(case, robot=case.robot.model_copy(update={"reference": reference}))
run = NativeRun(case, Setting(sys.argv[2], steps=2000), CompiledLaws.of(case.robot) if COMPILED else None)
run()
course = run.course()
other = OTHER
ours = recorded(case.robot, other)
print(np.abs(course.values - ours).max() / np.ptp(ours, axis=0).max())
"""
#: What it is compared with: the reference model, and Exudyn with Python functions at the same step.
REFERENCE = "simulate(case.robot, sensors=False, rtol=1e-10, atol=1e-12)"
PYTHON = "twin(case.robot, sensors=False, step=2.5e-4)"


def difference(motion: str, method: str, other: str, *, compiled: bool) -> float:
    """Largest difference of a quantity, relative to the largest range of its channels."""
    script = SCRIPT.replace("OTHER", other).replace("COMPILED", str(compiled))
    command = [sys.executable, "-W", "ignore", "-c", script, motion, method]
    environment = {**os.environ, SWITCH: "on" if compiled else "off"}
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, env=environment)
    assert process.returncode == 0, process.stderr
    return float(np.float64(process.stdout.splitlines()[-1]))


@pytest.mark.parametrize(
    ("motion", "method"),
    [
        ("arm, constant LuGre", "trapezoidal, index 2"),
        pytest.param("space arm, joint control", "RK44", marks=pytest.mark.proof),
        pytest.param("flexible, Stribeck", "generalised alpha", marks=pytest.mark.proof),
    ],
)
def test_native_exudyn_gives_the_same_motion(motion: str, method: str) -> None:
    # steps of 0.25 ms by second order
    assert difference(motion, method, REFERENCE, compiled=False) < 1e-5


@pytest.mark.skipif(compiler() is None, reason="no C compiler on the path")
@pytest.mark.parametrize(
    ("motion", "other"),
    [
        pytest.param("arm, LuGre", PYTHON, id="arm, Python", marks=pytest.mark.proof),
        pytest.param("arm, LuGre", REFERENCE, id="arm, reference", marks=pytest.mark.proof),
        # compiling the Jacobian takes half a minute
        pytest.param("flexible, LuGre", PYTHON, id="flexible, Python", marks=pytest.mark.proof),
        pytest.param("flexible, LuGre", REFERENCE, id="flexible, reference", marks=pytest.mark.proof),
    ],
)
def test_compiled_functions_give_the_same_motion(motion: str, other: str) -> None:
    # steps of 0.25 ms by second order: 3e-7 from the reference
    assert difference(motion, "trapezoidal, index 2", other, compiled=True) < 1e-6
