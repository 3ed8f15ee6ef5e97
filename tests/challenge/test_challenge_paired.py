"""Two engines on the same cases: closed forms of the tests and intervals."""

from __future__ import annotations

from math import comb, sqrt

import numpy as np
import pytest
from challenge_cases import score

from missing_physics.challenge.scoring.paired import compare, compare_numbers, compare_shares
from missing_physics.challenge.scoring.result import CaseScore, Finding
from robot_model import InputError


def pairs(both: int, gained: int, lost: int, neither: int) -> list[tuple[float, float]]:
    return [(1.0, 1.0)] * both + [(0.0, 1.0)] * gained + [(1.0, 0.0)] * lost + [(0.0, 0.0)] * neither


def test_mcnemar_counts_cases_in_which_the_engines_differ() -> None:
    """Exact: of 8 that differ 7 or more on one side have the chance 2 (1 + 8) / 2^8."""
    found = compare_shares("name", pairs(20, 7, 1, 12))
    assert (found.cases, found.better, found.worse) == (40, 7, 1)
    assert found.p_value == pytest.approx(2 * (comb(8, 0) + comb(8, 1)) / 2**8)
    assert found.first == pytest.approx(21 / 40)
    assert found.second == pytest.approx(27 / 40)
    assert found.difference == pytest.approx(6 / 40)


def test_the_interval_of_a_difference_of_shares_is_that_of_bonett_and_price() -> None:
    found = compare_shares("name", pairs(20, 7, 1, 12))
    up, down = 8 / 42, 2 / 42
    half = 1.959964 * sqrt((up + down - (up - down) ** 2) / 42)
    assert found.interval == pytest.approx((up - down - half, up - down + half))


def test_questions_with_a_bad_yes_are_compared_correctly() -> None:
    found = compare_shares("wrong", pairs(0, 3, 1, 6), good=False)
    assert (found.better, found.worse) == (1, 3)
    assert found.difference == pytest.approx(0.2)


def test_equal_engines_show_no_difference() -> None:
    found = compare_shares("name", pairs(5, 0, 0, 5))
    assert (found.p_value, found.difference) == (1.0, 0.0)
    assert found.interval[0] < 0 < found.interval[1]
    same = compare_numbers("s", [(1.0, 1.0)] * 4, larger=True)
    assert (same.better, same.worse, same.p_value) == (0, 0, 1.0)
    assert same.interval == (0.0, 0.0)


def test_numbers_are_compared_by_sign_test_and_students_interval() -> None:
    """Changes 1, 2, 3, -2: mean 1, standard deviation sqrt(14/3), quantile 3.182 of three degrees."""
    found = compare_numbers("log", [(0.0, 1.0), (0.0, 2.0), (0.0, 3.0), (0.0, -2.0)], larger=True)
    assert (found.better, found.worse) == (3, 1)
    assert found.p_value == pytest.approx(2 * (comb(4, 0) + comb(4, 1)) / 2**4)
    half = 3.182446 * sqrt(14 / 3) / 2
    assert found.interval == pytest.approx((1 - half, 1 + half), rel=1e-5)
    less = compare_numbers("seconds", [(0.0, 1.0), (0.0, -1.0), (0.0, -1.0)], larger=False)
    assert (less.better, less.worse) == (2, 1)


def test_single_case_has_no_interval_and_zero_cases_no_mean() -> None:
    assert compare_numbers("s", [(0.0, 1.0)], larger=True).interval == (-np.inf, np.inf)
    empty = compare_shares("s", [])
    assert (empty.cases, empty.p_value) == (0, 1.0)
    assert np.isnan(empty.difference)


RIGHT = Finding("coulomb_friction@joint1", 0.9, True)
WRONG = Finding("payload@link1", 0.95, False)


def engine(*changes: dict[str, object]) -> list[CaseScore]:
    return [score(number=k, **change) for k, change in enumerate(changes)]


def test_measures_are_compared_where_they_apply() -> None:
    old = engine(
        {"right_name": False, "findings": (WRONG,), "log_score": -9.2, "brier": 1.9, "seconds": 30.0},
        {"findings": (RIGHT,), "log_score": -0.1, "brier": 0.01, "seconds": 40.0},
        {"right_name": False, "identifiable": {"coulomb_friction@joint1": False}},
    )
    new = engine(
        {"findings": (RIGHT,), "log_score": -0.1, "brier": 0.01, "seconds": 5.0},
        {"findings": (RIGHT,), "log_score": -0.1, "brier": 0.01, "seconds": 6.0},
        {"identifiable": {"coulomb_friction@joint1": False}},
    )
    found = {row.name: row for row in compare(old, new).differences}
    named = found["name right, identifiable"]  # the third is not
    assert (named.cases, named.better, named.worse) == (2, 1, 0)
    wrong = found["a wrong name stated with more than 0.9"]
    assert (wrong.cases, wrong.better, wrong.worse) == (3, 1, 0)
    assert found["log score [nats]"].better == 1
    assert found["seconds"].better == 2
    assert found["false alarm where nothing is missing"].cases == 0


def test_only_common_cases_are_compared() -> None:
    assert compare(engine({}, {}, {}), engine({}, {})[1:]).cases == 1
    with pytest.raises(InputError, match="no case in common"):
        compare(engine({}), engine({}, {})[1:])


def test_different_cases_are_rejected() -> None:
    with pytest.raises(InputError, match="case 0 is not the same"):
        compare(engine({}), engine({"hidden": ("payload@link1",)}))


def test_held_out_ratio_weights_joints_by_their_noise() -> None:
    joints = {
        "a": {"noise": 1.0, "nominal": 3.0, "answer": 1.0},
        "b": {"noise": 10.0, "nominal": 40.0, "answer": 10.0},
    }
    assert score(held_out=joints).held_out_ratio == pytest.approx(sqrt(2 / 25))
    silent = {name: {"noise": own["noise"], "nominal": own["nominal"]} for name, own in joints.items()}
    assert score(held_out=silent).held_out_ratio == 1.0
    assert score().held_out_ratio is None
