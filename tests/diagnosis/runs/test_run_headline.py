"""The headline where runs in closed loop speak for everything that was named."""

from __future__ import annotations

import math

import pytest
from end_to_end_cases import AXIS, FRICTION, otherwise

from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.headline import as_runs_show
from missing_physics.results.result import Diagnosis, Finding, Fit, Result, Unnamed
from reference_model.simulation import simulate
from robot_model import Recording, robot_to_toml

LACKS = AXIS.model_copy(update={"effects": ()})
CURVE = Unnamed("joint1", "joint1.torque", "N", ("time",), "", 0.5, 1.0, ((),), (), "It changes with time.")


def recorded(seed: int) -> list[Recording]:
    return [simulate(r.with_effects(FRICTION), seed=seed) for r in (LACKS, otherwise(LACKS))]


def stated(torque: float) -> Result:
    """Friction of this size, of which torques say little."""
    named = Finding("coulomb_friction", "joint1", 0.97, {})
    fit = Fit({}, 0.04)
    told = Diagnosis("axis", ("one",), ("two",), "unexplained", "", (), (named,), fit, unnamed=(CURVE,))
    use = FRICTION.model_copy(update={"torque": torque})
    return Result(told, (), (), robot_to_toml(LACKS.with_effects(use)))


def test_the_headline_is_that_of_runs_which_come_down_to_the_noise() -> None:
    recordings = recorded(seed=18)
    replay = Replay.of(LACKS, recordings[:1], recordings[1:])
    assert replay is not None
    found = as_runs_show(stated(FRICTION.parameters["torque"]), LACKS, replay).diagnosis
    before, after = (replay.errors(robot, 1) for robot in (LACKS, LACKS.with_effects(FRICTION)))
    assert before is not None
    assert after is not None
    squares = [sum(float((e**2).sum() / e.size) for e in errors.values()) for errors in (before, after)]
    assert found.fit.validation_improvement == pytest.approx(1 - math.sqrt(squares[1] / squares[0]))
    assert found.fit.validation_improvement > 0.5
    assert found.verdict == "explained"
    assert found.unnamed == ()
    assert f"{found.fit.validation_improvement:.0%}" in found.summary
    assert any("of runs in closed loop" in note for note in found.notes)


def test_without_held_out_recordings_only_the_verdict_changes() -> None:
    replay = Replay.of(LACKS, recorded(seed=18)[:1])
    found = as_runs_show(stated(FRICTION.parameters["torque"]), LACKS, replay).diagnosis
    assert found.fit.validation_improvement == 0.04
    assert found.verdict == "explained"


def test_what_runs_do_not_bear_out_keeps_its_headline() -> None:
    recordings = recorded(seed=18)
    replay = Replay.of(LACKS, recordings[:1], recordings[1:])
    half = stated(0.5 * FRICTION.parameters["torque"])
    assert as_runs_show(half, LACKS, replay) is half
    assert as_runs_show(half, LACKS, None) is half
    near = as_runs_show(stated(0.97 * FRICTION.parameters["torque"]), LACKS, replay).diagnosis
    assert near.verdict == "unexplained"  # much less is left, and more than noise
    assert near.unnamed == (CURVE,)
    assert near.fit.validation_improvement > 0.5
