"""Runs in closed loop, and names between two encoders: what they take away, exchange, and leave alone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from two_encoders import arm, half_open

from missing_physics.diagnosis.gear.fit import GapFit, fit_gap
from missing_physics.diagnosis.gear.transmission import (
    JointWork,
    TransmissionResult,
    diagnose_transmission,
    result_of,
)
from missing_physics.diagnosis.gear_runs.applied import found_gears
from missing_physics.diagnosis.gear_runs.rivals import _with_odds, gaps_in_runs
from missing_physics.diagnosis.preparation.setup import make_segments
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.results.result import Alternative, Finding, Result
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, robot_from_toml, robot_to_toml

STOP = {"effect": "end_stop", "at": "joint2", "stiffness": 2e3, "position": 0.65, "side": 1.0}
SPRING = {"effect": "joint_elasticity", "at": "joint1", "stiffness": 2.4e4, "damping": 24.0}
LOSSY = {"effect": "gear_hysteresis", "at": "joint1", "torque": 4.0, "travel": 3e-4, "stiffness": 2.4e4}
LOSSY |= {"damping": 15.0}


@cache
def recorded(lossy: bool) -> tuple[Robot, tuple[Recording, Recording], TransmissionResult]:
    """An arm without gravity, two recordings of it with a gear and a stop at the other joint, its gaps."""
    robot = bare()
    assert robot.reference is not None
    other = tuple(
        m.model_copy(update={"phases": tuple(p + 0.7 for p in m.phases)}) for m in robot.reference.joints
    )
    recordings = []
    for seed, joints in enumerate((robot.reference.joints, other)):
        hidden = bare(STOP, LOSSY if lossy else SPRING)
        moved = hidden.model_copy(update={"reference": robot.reference.model_copy(update={"joints": joints})})
        recordings.append(simulate(moved, seed=31 + seed))
    segments = make_segments(robot, recordings)
    gap = diagnose_transmission(robot, recordings[:1], recordings[1:], segments=segments)
    assert gap is not None
    return robot, (recordings[0], recordings[1]), gap


def bare(*effects: dict[str, Any]) -> Robot:
    return arm(*effects, gravity=False, duration=7.0)


def run(
    gap: TransmissionResult, *, lossy: bool = False, beside: tuple[dict[str, Any], ...] = (STOP,)
) -> tuple[Result, TransmissionResult]:
    """`gaps_in_runs`, where the torques have shown what is `beside` the gear."""
    robot, recordings, _ = recorded(lossy)
    described = robot.with_effects(*found_gears(robot, gap).uses)
    written = described.with_effects(*(EffectUse(**use) for use in beside))
    found = replace(half_open(), augmented_robot_toml=robot_to_toml(written))
    replay = Replay.of(described, recordings)
    result, after = gaps_in_runs(found, gap, robot, replay, lambda phrase: None)
    assert after is not None
    return result, after


def with_fit(gap: TransmissionResult, fit: GapFit) -> TransmissionResult:
    """The gaps with another fit at joint1."""
    [own, *others] = gap.works
    return result_of([replace(own, fits=(fit,)), *others])


def named(gap: TransmissionResult) -> set[str]:
    return {f"{f.effect}@{f.location}" for f in gap.findings}


def spurious(work: JointWork) -> GapFit:
    """A spring and a hysteresis that the gear has not."""
    for shape in work.causes:
        if shape.key == ("gear_hysteresis", "joint1") and shape.torque is not None:
            fit = fit_gap(work.data, [*work.best.causes, shape])
            if fit.admissible:
                return fit
    raise AssertionError


@pytest.mark.proof
def test_a_gear_s_name_that_no_run_needs_goes_and_what_is_there_stays() -> None:
    _, _, gap = recorded(lossy=False)
    assert named(gap) == {"joint_elasticity@joint1"}
    false = with_fit(gap, spurious(gap.works[0]))
    assert named(false) == {"joint_elasticity@joint1", "gear_hysteresis@joint1"}
    found, after = run(false)
    assert named(after) == {"joint_elasticity@joint1"}
    assert any(
        "gear_hysteresis at joint1 is not named: run in closed loop" in s for s in after.could_not_tell
    )
    effects = {(u.effect, u.at) for u in robot_from_toml(found.augmented_robot_toml).effects}
    assert ("joint_elasticity", "joint1") in effects
    assert ("end_stop", "joint2") in effects
    assert ("gear_hysteresis", "joint1") not in effects
    stiffness = after.findings[0].parameters["stiffness"].value
    # 2.4e4 N m/rad; its interval, of a few parts in a thousand, is for proof tests
    assert stiffness == pytest.approx(2.4e4, rel=0.02)


@pytest.mark.proof
def test_runs_that_leave_the_gap_say_nothing() -> None:
    """With much more on the arm than there is, each run winds up its gear otherwise."""
    _, _, gap = recorded(lossy=False)
    false = with_fit(gap, spurious(gap.works[0]))
    heavy = {"effect": "payload", "at": "link2", "mass": 6.0, "x": 0.4, "y": 0.0, "z": 0.0}
    found, after = run(false, beside=(STOP, heavy))
    assert after is false
    assert ("gear_hysteresis", "joint1") in {
        (u.effect, u.at) for u in robot_from_toml(found.augmented_robot_toml).effects
    }


@pytest.mark.proof
def test_a_rival_that_runs_better_takes_the_place() -> None:
    """A spring alone is told where the gear has friction inside too; the regression calls both as likely."""
    _, _, gap = recorded(lossy=True)
    [own, *_] = gap.works
    springs = [fit_gap(own.data, [c]) for c in own.causes if c.key == ("joint_elasticity", "joint1")]
    alone = min((f for f in springs if f.admissible), key=lambda f: f.rms(own.data.fitted))
    rival = Alternative("gear_hysteresis", "joint1", 0.45, "cannot be told apart with these data")
    before = with_fit(gap, alone)
    doubtful = replace(
        before.findings[0], probability=0.5, alternatives=(rival,), ambiguous_with=("gear_hysteresis@joint1",)
    )
    found, after = run(
        result_of([replace(before.works[0], by_runs=(doubtful,)), *before.works[1:]]), lossy=True
    )
    assert named(after) == {"joint_elasticity@joint1", "gear_hysteresis@joint1"}
    assert {(u.effect, u.at) for u in robot_from_toml(found.augmented_robot_toml).effects} >= {
        ("gear_hysteresis", "joint1"),
        ("joint_elasticity", "joint1"),
    }
    torque = next(f for f in after.findings if f.effect == "gear_hysteresis").parameters["torque"]
    low, high = torque.ci95
    assert low <= 4.0 <= high


def test_a_rival_that_runs_ruled_out_is_reported_with_what_its_run_leaves() -> None:
    rival = Alternative("backlash", "joint1", 0.45, "cannot be told apart with these data")
    quiet = Alternative("link_flexibility", "link1", 0.05, "cannot be told apart with these data")
    before = Finding("joint_elasticity", "joint1", 0.5, {}, ("backlash@joint1",), alternatives=(rival, quiet))
    after = _with_odds(before, {("backlash", "joint1"): -7.0}, 0.004, {("backlash", "joint1"): 0.37})
    told = {a.effect: a for a in after.alternatives}
    assert "37 %" in told["backlash"].why_not
    assert "0.4 %" in told["backlash"].why_not
    assert told["backlash"].probability < 0.001
    assert told["link_flexibility"].why_not == quiet.why_not
    # what was not run keeps its odds, and all together what they had
    assert told["link_flexibility"].probability == pytest.approx(0.1 * after.probability)
    assert after.probability + sum(a.probability for a in after.alternatives) == pytest.approx(1.0)
    assert after.ambiguous_with == ("link_flexibility@link1",)
    assert _with_odds(before, {}, 0.0, {}) is before
