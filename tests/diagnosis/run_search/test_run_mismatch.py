"""What runs in closed loop show where torques along the motion show nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from end_to_end_cases import ARM, AXIS, FRICTION, QUICK, otherwise
from rescue_cases import SPRING, deafened

from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis import one_look
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.run_search.mismatch import colour_chance, differing_in_runs
from reference_model.simulation import simulate
from robot_model import Recording, Robot


def replay_of(described: Robot, real: Robot, **noise: float) -> Replay:
    recordings = [recorded(r, seed, **noise) for seed, r in enumerate((real, otherwise(real)))]
    replay = Replay.of(described, recordings[:1], recordings[1:])
    assert replay is not None
    return replay


def recorded(robot: Robot, seed: int, times: float = 1.0) -> Recording:
    """With sensors that scatter more than the file says, which the recording does not state."""
    sensors = tuple(s.model_copy(update={"noise": times * s.noise}) for s in robot.sensors)
    return replace(simulate(robot.model_copy(update={"sensors": sensors}), seed=seed), noise={})


def test_the_joint_that_differs_is_named_with_all_its_shares() -> None:
    found = differing_in_runs(replay_of(ARM, ARM.with_effects(FRICTION)))
    assert found[0].location == "joint1"
    assert sum(item.share for item in found) == pytest.approx(1.0)
    assert all(item.p_value < 1e-6 for item in found)


def test_noise_that_is_greater_than_stated_is_no_mismatch() -> None:
    """Nine times the energy, and white."""
    loud = replay_of(AXIS, AXIS, times=3.0)
    energies = loud.energies(AXIS, 0)
    assert energies is not None
    assert energies.min() > 5.0
    assert not [item for item in differing_in_runs(loud) if item.p_value < 1e-4]


def test_nothing_differs_where_nothing_is_missing() -> None:
    assert differing_in_runs(replay_of(AXIS, AXIS)) == ()
    assert differing_in_runs(None) == ()


def test_what_differs_in_one_recording_alone_is_not_reported() -> None:
    """It began elsewhere, or was pushed: no law of the robot."""
    recordings = [simulate(AXIS.with_effects(FRICTION), seed=1), simulate(otherwise(AXIS), seed=2)]
    assert differing_in_runs(Replay.of(AXIS, recordings[:1], recordings[1:])) == ()


@pytest.mark.parametrize(("times", "told"), [(1.0, False), (100.0, True)])
def test_what_beams_may_make_in_one_recording_hides_nothing_far_beyond_it_in_another(
    times: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    replay = replay_of(AXIS.with_effects(FRICTION), AXIS)
    energies = [replay.energies(replay.robot, which) for which in (0, 1)]
    assert energies[0] is not None
    assert energies[1] is not None
    doubts = [energies[0] / times, energies[1]]
    monkeypatch.setattr(Replay, "doubt", lambda self, which: doubts[which])
    assert bool(differing_in_runs(replay)) is told


def test_the_chance_of_white_noise_is_uniform_and_of_anything_slow_is_none() -> None:
    rng = np.random.default_rng(3)
    drawn = [colour_chance(rng.normal(size=1000)) for _ in range(400)]
    # a mean of 400 uniform numbers scatters by 0.0144; five of those
    assert abs(np.mean(drawn) - 0.5) < 0.072
    slow = np.sin(np.linspace(0, 20, 1000)) + rng.normal(size=1000)
    assert colour_chance(slow) < 1e-6


@pytest.mark.proof
@pytest.mark.parametrize("there", [True, False])
def test_such_a_robot_is_not_called_consistent(there: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where torques and a search by runs are said to show nothing."""
    deafened(monkeypatch)
    monkeypatch.setattr(one_look, "found_by_runs", lambda *_: None)
    lacks = AXIS.model_copy(update={"effects": ()})
    real = lacks.with_effects(SPRING) if there else lacks
    recordings = [simulate(r, seed=k) for k, r in enumerate((real, otherwise(real)))]
    told = diagnose(lacks, recordings[:1], recordings[1:], options=QUICK).diagnosis
    assert told.verdict == ("unexplained" if there else "consistent")
    assert {item.location for item in told.mismatch} == ({"joint1"} if there else set())
    assert ("run in closed loop" in told.summary) is there
