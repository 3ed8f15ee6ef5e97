"""Proper scores of stated probabilities, against their closed forms."""

from __future__ import annotations

from math import log

import numpy as np
import pytest
from challenge_cases import answer, hiding, made

from missing_physics.challenge.scoring.probability import FLOOR, probability_score
from missing_physics.challenge.scoring.score import stated_and_true

A, B = "coulomb_friction@joint1", "payload@link2"


def test_a_perfect_answer() -> None:
    """Certainty gains nothing over 0.99: both cost a hundredth of a nat."""
    for sure in (0.99, 1.0):
        assert probability_score({A: sure}, [A]).log == pytest.approx(log(0.99))
    assert probability_score({A: 1.0}, [A]).brier == 0.0
    nothing = probability_score({}, [])
    assert (nothing.log, nothing.brier, nothing.candidates) == (0, 0, 0)


def test_an_ignorant_answer() -> None:
    """One half for each of n candidates costs log 2 and a quarter each, whatever is there."""
    for there in ([], [A], [A, B]):
        score = probability_score({A: 0.5, B: 0.5}, there)
        assert score.log == pytest.approx(-2 * log(2))
        assert score.brier == pytest.approx(0.5)
        assert score.candidates == 2


def test_a_wrong_answer() -> None:
    """Sure of what is not there, and silent on what is: the floor twice, and two whole errors."""
    score = probability_score({B: 1.0}, [A])
    assert score.log == pytest.approx(2 * log(FLOOR))
    assert score.brier == 2.0
    assert score.candidates == 2


def test_both_scores_are_sums_over_candidates() -> None:
    score = probability_score({A: 0.8, B: 0.3}, [A])
    assert score.log == pytest.approx(log(0.8) + log(0.7))
    assert score.brier == pytest.approx(0.2**2 + 0.3**2)


@pytest.mark.parametrize("truth", [0.1, 0.35, 0.8])
def test_honest_probabilities_score_best(truth: float) -> None:
    """Both scores are proper: their expectation is best at the true probability."""
    message = np.linspace(0.02, 0.98, 97)
    for key, sign in (("log", 1), ("brier", -1)):
        yes, no = (
            np.array([getattr(probability_score({A: p}, there), key) for p in message]) for there in ([A], [])
        )
        expected = sign * (truth * yes + (1 - truth) * no)
        assert message[np.argmax(expected)] == pytest.approx(truth, abs=0.011)


def with_rivals(*rivals: tuple[str, str, float]) -> dict[str, object]:
    message = answer("ambiguous", ("stribeck_friction", "joint1", 0.6))
    message["findings"][0]["alternatives"] = [  # type: ignore[index]
        {"effect": effect, "location": at, "probability": p, "why_not": ""} for effect, at, p in rivals
    ]
    return message


def test_rivals_of_a_finding_are_mentioned_with_their_probability() -> None:
    case = hiding("coulomb_friction", "joint1", torque=8.0)
    given = made(case).given
    stated, there = stated_and_true(case, given, with_rivals(("coulomb_friction", "joint1", 0.3)))
    assert stated == {"stribeck_friction@joint1": 0.6, A: 0.3}
    assert there == {A}
    nothing, hidden = stated_and_true(case, given, None)
    assert nothing == {}
    assert hidden == {A}


def test_a_finding_counts_before_a_rival_of_the_same_name() -> None:
    case = hiding("coulomb_friction", "joint1", torque=8.0)
    message = with_rivals(("stribeck_friction", "joint1", 0.1), ("viscous_friction", "joint1", 0.2))
    stated, _ = stated_and_true(case, made(case).given, message)
    assert stated == {"stribeck_friction@joint1": 0.6, "viscous_friction@joint1": 0.2}


def test_rival_that_may_correct_the_file_is_excluded() -> None:
    case = hiding("coulomb_friction", "joint1", torque=8.0)
    errors = {"file_errors": {"carriage.mass": 0.05}}
    wrong = case.model_copy(update={"conditions": case.conditions.model_copy(update=errors)})
    message = with_rivals(("payload", "carriage", 0.3), ("cable_spring", "joint1", 0.1))
    for truth, mentioned in ((case, 3), (wrong, 2)):
        stated, _ = stated_and_true(truth, made(truth).given, message)
        assert len(stated) == mentioned
