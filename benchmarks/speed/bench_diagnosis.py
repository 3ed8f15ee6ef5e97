"""How long a diagnosis of 25 s at 1 kHz of one axis takes: it should be under 10 s on two cores.

    make bench ARGS="-k diagnosis"

Reading and simulating are set-up and not timed; the report is not written. Findings are checked by the tests;
here they are stored with the time in `extra_info`.
"""

from __future__ import annotations

import os

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.evidence import EXAMPLES, recording_of
from missing_physics.diagnosis import Options, Result, diagnose
from missing_physics.recordings.datasets import DATA_VARIABLE, local_folder
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, load_robot

#: Length of the benchmark [s], at the robot's 1 kHz.
DURATION = 25.0
#: Rounds of a command of seconds: the first one only fills the cache of compiled code.
ROUNDS = 2
MISSING = EffectUse.model_validate({"effect": "torque_offset", "at": "joint1", "torque": 8.0})


def timed(benchmark: BenchmarkFixture, robot: Robot, *recordings: Recording) -> None:
    """Time the diagnosis of the first recording, validated on the others."""
    result: Result = benchmark.pedantic(
        diagnose,
        args=(robot, recordings[:1], recordings[1:]),
        kwargs={"options": Options()},
        rounds=ROUNDS,
    )
    benchmark.extra_info["samples"] = len(recordings[0])
    benchmark.extra_info["findings"] = [f.effect for f in result.diagnosis.findings]


@pytest.mark.benchmark(group="diagnosis, 25 s at 1 kHz of one axis")
def test_simulated_axis(benchmark: BenchmarkFixture) -> None:
    robot = load_robot("single_axis")
    assert robot.reference is not None
    longer = robot.reference.model_copy(update={"duration": DURATION})
    real = robot.with_effects(MISSING).model_copy(update={"reference": longer})
    timed(benchmark, robot, simulate(real, seed=1))


@pytest.mark.benchmark(group="diagnosis, 25 s at 1 kHz of one axis")
@pytest.mark.parametrize("nominal", ["mass_only", "published"])
def test_emps(benchmark: BenchmarkFixture, nominal: str) -> None:
    folder = local_folder("emps")
    if folder is None:
        pytest.skip(f"{DATA_VARIABLE} names no folder with emps ({os.environ.get(DATA_VARIABLE, 'unset')})")
    robot = load_robot(EXAMPLES / "emps" / f"{nominal}.toml")
    files = ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")
    timed(benchmark, robot, *(recording_of(folder, file, example="emps") for file in files))
