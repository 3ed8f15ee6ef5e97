"""What lies above the first cut-off is named by a second look, and only where something is there."""

from __future__ import annotations

from dataclasses import replace

import pytest
from end_to_end_cases import QUICK, shortened, within

from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.preparation.setup import make_segments
from missing_physics.diagnosis.second_look import clearer_cutoff, named_by, nameless
from missing_physics.results.result import Result
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot

#: A push of 0.15 s, briefer than two periods of the first cut-off.
PUSH = {"torque": 3.0, "start": 6.0, "duration": 0.15}
FAST = replace(QUICK, simulation=False)


def arm() -> Robot:
    """An arm whose first encoder is so noisy that torques are compared below 10 Hz."""
    robot = shortened("two_link_arm", duration=20.0, rate=250.0)
    noise = {"joint1.position": 3e-4}
    sensors = tuple(s.model_copy(update={"noise": noise.get(s.channel, s.noise)}) for s in robot.sensors)
    return robot.model_copy(update={"sensors": sensors})


@pytest.fixture(scope="module")
def pushed() -> Recording:
    return simulate(arm().with_effects(EffectUse(effect="external_torque", at="joint2", **PUSH)), seed=1)


@pytest.fixture(scope="module")
def looks(pushed: Recording) -> tuple[Result, Result]:
    """At a low and at a high cut-off that were asked for."""
    low, high = (diagnose(arm(), [pushed], options=replace(FAST, cutoff=c)) for c in (9.0, 20.0))
    return low, high


@pytest.mark.proof
def test_a_push_briefer_than_the_cutoff_resolves_is_named(pushed: Recording) -> None:
    found = diagnose(arm(), [pushed], options=FAST).diagnosis
    [finding] = found.findings
    assert (found.verdict, finding.effect, finding.location) == ("explained", "external_torque", "joint2")
    for name, value in PUSH.items():
        assert within(finding.parameters[name], value), (name, finding.parameters[name])
    assert any("A lower cut-off was tried first" in note for note in found.notes)


@pytest.mark.proof
def test_a_cutoff_that_was_asked_for_is_kept(looks: tuple[Result, Result]) -> None:
    found = looks[0].diagnosis
    assert found.verdict == "unexplained"
    assert not found.findings
    assert "below 9 Hz" in found.notes[0]


def test_a_wider_cutoff_is_taken_only_where_something_is_beyond_noise(pushed: Recording) -> None:
    robot = arm()
    for recording, expected in ((pushed, True), (simulate(robot, seed=2), False)):
        segments = make_segments(robot, [recording])
        first = segments[0].motion.low_pass.cutoff
        wider = clearer_cutoff(robot, [recording], segments, seed=0)
        assert (wider is not None) == expected
        assert wider is None or 1.5 * first < wider <= 0.08 * 250.0 * (1.0 + 1e-9)  # rounding of the rate


@pytest.mark.proof
def test_a_second_look_counts_only_where_it_names_something(looks: tuple[Result, Result]) -> None:
    first, second = looks
    assert nameless(first)
    assert not nameless(second)
    assert named_by(first, first) is first
    told = named_by(first, second).diagnosis
    assert told.findings == second.diagnosis.findings
    assert len(told.notes) == len(second.diagnosis.notes) + 1
    doubtful = replace(second, diagnosis=replace(second.diagnosis, verdict="unexplained"))
    assert named_by(first, doubtful) is first
