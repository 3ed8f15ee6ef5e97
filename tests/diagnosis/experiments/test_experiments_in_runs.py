"""Motions designed by runs: for gears, whose play a recorded motion never crosses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from two_encoders import arm, half_open

from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.experiments import runs as experiments_in_runs
from missing_physics.diagnosis.experiments.design import still_needed
from missing_physics.diagnosis.experiments.runs import RunBench
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.recordings import load_recording
from missing_physics.results.result import Diagnosis, Estimate, Finding, Result
from reference_model.simulation import simulate
from robot_model import Actuator, Recording, Reference, Robot, Table, robot_to_toml

SPRING = {"effect": "joint_elasticity", "at": "joint1", "stiffness": 2.4e4, "damping": 24.0}
PLAY = {"effect": "backlash", "at": "joint1", "half_width": 5e-4}
PAIR = frozenset(("joint_elasticity", "backlash"))


def leaning(*effects: dict[str, object], duration: float = 8.0, turned: float = 0.0) -> Robot:
    """The arm near the horizontal, where its weight presses on one flank; it may turn further."""
    robot = arm(*effects, duration=duration)
    joints = tuple(j.model_copy(update={"position_limits": (-3.0, 3.0)}) for j in robot.joints)
    assert robot.reference is not None
    asked = tuple(
        m.model_copy(update={"phases": tuple(p + turned for p in m.phases)}) for m in robot.reference.joints
    )
    reference = robot.reference.model_copy(update={"joints": asked})
    return robot.model_copy(update={"joints": joints, "reference": reference})


def asked_to(robot: Robot, motion: Recording) -> Robot:
    """A robot with a recorded motion as its reference."""
    tables = tuple(
        Table(
            joint=joint.name,
            times=tuple(motion.time),
            positions=tuple(motion[f"{joint.name}.reference_position"]),
        )
        for joint in robot.moving_joints
    )
    reference = Reference(duration=motion.duration, sample_rate=500.0, joints=tables)
    return robot.model_copy(update={"reference": reference})


def of_the_gear(diagnosis: Diagnosis) -> set[str]:
    return {f.effect for f in diagnosis.findings} | {
        label for f in diagnosis.findings for label in f.ambiguous_with
    }


@pytest.mark.proof
def test_the_motion_when_run_tells_that_there_is_no_play(tmp_path: Path) -> None:
    nominal, first, second = leaning(), leaning(SPRING), leaning(SPRING, turned=0.7)
    recordings = [simulate(first, seed=1), simulate(second, seed=2)]
    result = diagnose(nominal, recordings[:1], recordings[1:])
    assert result.diagnosis.verdict == "ambiguous"
    assert of_the_gear(result.diagnosis) == {"joint_elasticity", "backlash@joint1"}
    [told] = [e for e in result.diagnosis.experiments if frozenset(e.separates) == PAIR]
    assert told.motion is not None
    assert "times the noise of" in told.why
    (tmp_path / told.motion).write_text(result.experiment_motions[told.motion])
    further = simulate(asked_to(first, load_recording(tmp_path / told.motion)), seed=3)
    after = diagnose(nominal, [recordings[0], further], recordings[1:]).diagnosis
    assert after.verdict == "explained"
    assert of_the_gear(after) == {"joint_elasticity"}


@pytest.mark.proof
@pytest.mark.parametrize("half_width", [PLAY["half_width"], 1e-4])
def test_play_that_runs_tell_needs_no_further_motion(half_width: float) -> None:
    """The regression along the recorded motion cannot tell it from the spring alone; runs can."""
    hidden = [SPRING, {**PLAY, "half_width": half_width}]
    nominal, first, second = leaning(), leaning(*hidden), leaning(*hidden, turned=0.7)
    told = diagnose(nominal, [simulate(first, seed=1)], [simulate(second, seed=2)]).diagnosis
    assert told.verdict == "explained"
    assert of_the_gear(told) == {"joint_elasticity", "backlash"}
    [play] = [f for f in told.findings if f.effect == "backlash"]
    low, high = play.parameters["half_width"].ci95
    assert low < half_width < high
    assert not told.experiments


def answered(label: str = "backlash@joint1") -> Result:
    """A spring that may as well have play."""
    estimates = {
        name: Estimate(float(str(SPRING[name])), (0.0, 1e6), "") for name in ("stiffness", "damping")
    }
    finding = Finding("joint_elasticity", "joint1", 0.5, estimates, (label,))
    half = half_open()
    told = replace(half.diagnosis, findings=(finding,), experiments=())
    return replace(half, diagnosis=told, augmented_robot_toml=robot_to_toml(leaning(SPRING, duration=2.0)))


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> RunBench:
    for name, value in {"LENGTH": 3.0, "DRAWN": 2, "TRIED": 1}.items():
        monkeypatch.setattr(experiments_in_runs, name, value)
    return on(leaning(duration=2.0))


def on(nominal: Robot) -> RunBench:
    truth = leaning(SPRING, duration=2.0).model_copy(update={"joints": nominal.joints})
    replay = Replay.of(nominal, [simulate(truth, seed=1)])
    assert replay is not None
    return RunBench(nominal, replay, seed=0)


@pytest.mark.proof
def test_a_motion_within_the_limits_and_words_for_it(bench: RunBench, tmp_path: Path) -> None:
    result = still_needed(answered(), bench)
    [told] = result.diagnosis.experiments
    assert told.separates == ("joint_elasticity", "backlash")
    assert told.motion == "experiment_1.csv"
    assert "half_width 0.0005" in told.why  # of play that is not seen, as large as it usually is
    (tmp_path / told.motion).write_text(result.experiment_motions[told.motion])
    motion = load_recording(tmp_path / told.motion)
    for joint in bench.robot.moving_joints:
        position = motion[f"{joint.name}.reference_position"]
        assert joint.position_limits is not None
        assert joint.velocity_limit is not None
        assert joint.position_limits[0] <= position.min() < position.max() <= joint.position_limits[1]
        assert np.abs(np.gradient(position, motion.time)).max() <= joint.velocity_limit
        assert position[0] == pytest.approx(joint.initial_position, abs=1e-9)
    again = still_needed(answered(), RunBench(bench.robot, bench.replay, seed=0))
    assert again.experiment_motions == result.experiment_motions


@pytest.mark.proof
def test_what_needs_more_torque_than_there_is_or_cannot_be_run_has_words_only(bench: RunBench) -> None:
    weak = tuple(
        j.model_copy(update={"actuator": (j.actuator or Actuator()).model_copy(update={"torque_limit": 1.0})})
        for j in bench.robot.joints
    )
    limited = RunBench(bench.robot.model_copy(update={"joints": weak}), bench.replay)
    unknown = answered("temperature_dependent_friction@joint1")  # no run has a joint that warms
    for result, by in ((answered(), limited), (unknown, bench), (answered(), None)):
        [told] = still_needed(result, by).diagnosis.experiments
        assert told.motion is None
        assert "no motion was designed" in told.why
        assert told.do
    spent = RunBench(bench.robot, bench.replay, made=experiments_in_runs.MOST_PAIRS)
    assert spent.designed(answered(), answered().diagnosis.findings[0], "backlash@joint1", "a.csv") is None
