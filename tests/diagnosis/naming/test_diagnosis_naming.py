"""What must hold before an effect is named: strong evidence, and data that no fit has seen."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import ARM, bare, plain_view, problem_of, recorded

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.naming.search import ODDS, Search, name_effects
from robot_model import Recording

ROBOT = bare("two_link_arm", noise=True)


def dry(torque: float, *, seed: int) -> Recording:
    """The arm with Coulomb friction at joint 1."""
    return recorded(
        ROBOT,
        ARM,
        lambda t, q, qd, qdd: torque * np.sign(qd) * np.array([1.0, 0.0]),
        duration=16.0,
        seed=seed,
    )


def search(made: Recording, refusal: str = "") -> Search:
    problem = problem_of(ROBOT, made)
    view = plain_view(problem, scale=problem.noise_floor)
    return name_effects(problem, view, (), proof=lambda before, after: refusal, progress=lambda phrase: None)


@pytest.mark.proof
def test_unseen_data_have_a_veto() -> None:
    free, refused = search(dry(2.0, seed=1)), search(dry(2.0, seed=1), "not in the other recording")
    assert [t.label for t in free.best.found] == ["coulomb_friction@joint1"]
    # an event is no business of other data: whether it is one is asked of its own recording, later on
    assert all(t.effect.is_event for t in refused.best.found)
    assert "not in the other recording" in {rung.why for rung in refused.ladder}
    assert all(rung.effect == "external_torque" for rung in refused.ladder if rung.kept)


@pytest.mark.parametrize("torque", [0.006, 0.009, 0.012])
def test_weak_evidence_names_nothing(torque: float) -> None:
    """Odds of a hundred to one against every candidate that was tried, however well the rest looks."""
    for seed in range(3):
        found = search(dry(torque, seed=seed))
        for rung in found.ladder:
            assert not rung.kept or rung.evidence > np.log(ODDS * found.tried)


@pytest.mark.proof
def test_the_validation_recording_changes_no_parameter() -> None:
    made = dry(2.0, seed=1)
    answers = [
        diagnose(ROBOT, [made], [dry(torque, seed=2)], options=Options(experiments=False)).diagnosis
        for torque in (2.0, 2.3)
    ]
    for found in answers:
        assert [f.effect for f in found.findings] == ["coulomb_friction"]
    assert answers[0].findings[0].parameters == answers[1].findings[0].parameters
    assert answers[0].fit.validation_improvement > answers[1].fit.validation_improvement


@pytest.mark.proof
def test_what_the_validation_recording_does_not_have_is_not_named() -> None:
    found = diagnose(
        ROBOT, [dry(2.0, seed=1)], [dry(0.0, seed=2)], options=Options(experiments=False)
    ).diagnosis
    assert found.findings == ()
    assert found.verdict == "unexplained"
