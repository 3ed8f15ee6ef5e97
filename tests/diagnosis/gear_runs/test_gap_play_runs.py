"""Play in a gear that a regression does not tell from its spring, and runs do."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from end_to_end_cases import otherwise
from two_encoders import arm

from missing_physics.diagnosis.gear_runs.play import play_in_runs
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.results.result import Alternative, Estimate, Finding
from reference_model.simulation import simulate
from robot_model import Recording, Robot

STIFFNESS, WIDTH = 6e4, 4e-4
SPRING = {"effect": "joint_elasticity", "at": "joint1", "stiffness": STIFFNESS, "damping": 60.0}
PLAY = {"effect": "backlash", "at": "joint1", "half_width": WIDTH}


@cache
def recorded(play: bool) -> tuple[Robot, tuple[Recording, ...]]:
    """An arm under gravity, whose flanks hardly ever part, and two recordings of it."""
    described = arm(duration=3.0, sample_rate=250.0)
    real = arm(SPRING, *([PLAY] if play else []), duration=3.0, sample_rate=250.0)
    return described, tuple(simulate(r, seed=61 + k) for k, r in enumerate((real, otherwise(real))))


def told(open_: bool = True, stiffness: float = 0.9 * STIFFNESS) -> Finding:
    """What a regression says that saw flanks on one side alone."""
    rival = Alternative("backlash", "joint1", 0.48, "cannot be told apart with these data")
    number = Estimate(stiffness, (0.8 * stiffness, 1.2 * stiffness), "N m/rad")
    named = Finding("joint_elasticity", "joint1", 0.48, {"stiffness": number}, alternatives=(rival,))
    return replace(named, ambiguous_with=("backlash@joint1",) if open_ else ())


def findings(play: bool, finding: Finding) -> tuple[Finding, ...] | None:
    robot, recordings = recorded(play)
    replay = Replay.of(robot, recordings[:1], recordings[1:])
    assert replay is not None
    one = recordings[0]
    gap = one["joint1.position"] - one["joint1.motor_position"]
    return play_in_runs((finding,), "joint1", [gap], robot, replay)


def test_play_is_named_with_its_numbers() -> None:
    found = findings(True, told())
    assert found is not None
    spring, play = found
    assert (spring.effect, play.effect) == ("joint_elasticity", "backlash")
    assert play.parameters["half_width"].value == pytest.approx(WIDTH, rel=0.05)
    low, high = spring.parameters["stiffness"].ci95
    assert low <= STIFFNESS <= high
    assert play.probability > 0.9
    assert "backlash@joint1" not in spring.ambiguous_with
    assert play.parameters["half_width"].unit == "rad"


@pytest.mark.proof
def test_a_spring_without_play_stays_what_it_is() -> None:
    assert findings(False, told()) is None


def test_nothing_is_run_where_the_regression_is_sure() -> None:
    assert findings(True, told(open_=False)) is None


def test_a_motor_without_inertia_is_not_run() -> None:
    robot, recordings = recorded(False)
    replay = Replay.of(robot, recordings[:1], recordings[1:])
    assert replay is not None
    joints = []
    for joint in robot.joints:
        actuator = joint.actuator and joint.actuator.model_copy(update={"rotor_inertia": 0.0})
        joints.append(joint.model_copy(update={"actuator": actuator}))
    light = robot.model_copy(update={"joints": tuple(joints)})
    assert play_in_runs((told(),), "joint1", [np.zeros(9)], light, replay) is None


@pytest.mark.proof
def test_zeros_of_encoders_are_left_free() -> None:
    """A motor's encoder whose zero is off by the play's half width: no play, whatever the mean says."""
    robot, recordings = recorded(False)
    shifted = tuple(
        replace(r, channels={**r.channels, "joint1.motor_position": r["joint1.motor_position"] + WIDTH})
        for r in recordings
    )
    replay = Replay.of(robot, shifted[:1], shifted[1:])
    assert replay is not None
    gap = shifted[0]["joint1.position"] - shifted[0]["joint1.motor_position"]
    assert play_in_runs((told(),), "joint1", [gap], robot, replay) is None
