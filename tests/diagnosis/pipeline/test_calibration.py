"""Probabilities as they are stated."""

from __future__ import annotations

import pytest
from end_to_end_cases import AXIS, QUICK

from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.calibration import STATED, TRUST, WRONG, calibrated
from missing_physics.results.result import Alternative, Diagnosis, Finding, Fit, Result
from reference_model.simulation import simulate
from robot_model import EffectUse, robot_to_toml


def test_the_trust_is_what_was_counted() -> None:
    assert 0 <= WRONG < STATED
    assert pytest.approx((STATED - WRONG + 1) / (STATED + 2)) == TRUST


def test_every_name_and_its_rivals_are_less_probable_and_the_summary_says_so() -> None:
    rival = Alternative("viscous_friction", "joint1", 0.2, "")
    named = Finding("coulomb_friction", "joint1", 0.8, {}, ("viscous_friction@joint1",), (rival,))
    told = Diagnosis("axis", ("one",), (), "ambiguous", "as before", (), (named,), Fit({}, 0.9))
    found = calibrated(Result(told, (), (), robot_to_toml(AXIS)), AXIS).diagnosis
    assert found.findings[0].probability == pytest.approx(0.8 * TRUST)
    assert found.findings[0].alternatives[0].probability == pytest.approx(0.2 * TRUST)
    assert f"({0.8 * TRUST:.0%})" in found.summary
    assert found.verdict == told.verdict


@pytest.mark.proof
def test_nothing_is_stated_with_more_than_the_trust() -> None:
    friction = EffectUse(effect="coulomb_friction", at="joint1", torque=30.0)
    found = diagnose(AXIS, [simulate(AXIS.with_effects(friction), seed=24)], options=QUICK).diagnosis
    assert [f.effect for f in found.findings] == [friction.effect]
    assert 0.9 < found.findings[0].probability <= TRUST
    assert f"({found.findings[0].probability:.0%})" in found.summary


def test_an_answer_without_names_stays_as_it_is() -> None:
    told = Diagnosis("axis", ("one",), (), "consistent", "as before", (), (), Fit({}, 0.0))
    result = Result(told, (), (), robot_to_toml(AXIS))
    assert calibrated(result, AXIS) is result
