"""Whether a law keeps its numbers: a forecast's error against the uncertainty of the numbers that made it."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import Sines, bare, plain_view, problem_of, recorded, term
from scipy import stats

from missing_physics.diagnosis.least_squares.explanation import explain
from missing_physics.diagnosis.preparation.proof import HeldOut
from missing_physics.diagnosis.statistics.folds import FOLDS, forecast_error, jackknife, solved
from missing_physics.diagnosis.unnamed.adequacy import HALF_BELIEVED
from missing_physics.diagnosis.unnamed.curves import LawFree

NEAR = (Sines((0.06, 0.035, 0.012), (0.15, 0.37, 0.83), (0.0, 1.3, 2.1)),)
FAR = (Sines((0.1, 0.05, 0.02), (0.13, 0.33, 0.71), (0.4, 0.9, 0.1)),)


def test_forecast_error_is_exceeded_as_seldom_as_it_says() -> None:
    """A line fitted near nothing foretells far off: its error there is that of its slope."""
    rng = np.random.default_rng(10691)
    groups, length, trials = 8, 40, 400
    blocks = np.repeat(np.arange(4 * groups), length // 4)
    asked = np.array([[1.0, 5.0]])
    exceeded = 0
    for _ in range(trials):
        x = np.column_stack([np.ones(groups * length), rng.uniform(-1, 1, groups * length)])
        y = x @ np.array([0.3, 2.0]) + rng.standard_normal(len(x))
        beta = solved(x.T @ x, x.T @ y)
        wrong = float((asked[0] @ (beta - np.array([0.3, 2.0]))) ** 2)
        exceeded += wrong > forecast_error(np.column_stack([x, y]), blocks, np.zeros(2), asked)
    # 5 % of 400 is 20 +- 4.4; three of those.
    assert 7 <= exceeded <= 33


@pytest.mark.parametrize("groups", [2, 4, 12])
def test_the_interval_of_a_mean_is_students(groups: int) -> None:
    values = np.random.default_rng(groups).normal(3.0, 2.0, groups)
    without = np.array([[np.delete(values, k).mean()] for k in range(groups)])
    low, high = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert jackknife(without)[0] == pytest.approx(0.5 * (high - low), rel=1e-9)


def test_the_forecast_of_a_mean_is_off_by_its_interval() -> None:
    groups = FOLDS
    values = np.random.default_rng(11).normal(3.0, 2.0, groups)
    rows = np.column_stack([np.ones(groups), values])
    found = forecast_error(rows, np.arange(groups), np.zeros(1), np.ones((3, 1)))
    low, high = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert found == pytest.approx((0.5 * (high - low)) ** 2, rel=1e-9)


def test_one_stretch_alone_predicts_nothing_for_sure() -> None:
    rows = np.ones((10, 2))
    assert np.isinf(forecast_error(rows, np.zeros(10, dtype=int), np.zeros(1), np.ones((3, 1))))


@pytest.mark.parametrize(("power", "stiffness"), [(1, 600.0), (3, 6e4)])
def test_only_a_law_that_stands_for_another_needs_other_numbers_further_out(
    power: int, stiffness: float
) -> None:
    """A spring, and a cubic one, both called a spring; the held-out motion reaches further."""
    robot = bare("single_axis", noise=True)
    near, far = (
        problem_of(
            robot,
            recorded(
                robot, motion, lambda t, q, qd, qdd: stiffness * q**power, duration=24.0, seed=10692 + power
            ),
        )
        for motion in (NEAR, FAR)
    )
    view = plain_view(near)
    spring = term("cable_spring", "joint1", stiffness=0.0)
    named = explain(near, view, [spring])
    free = LawFree(named, HeldOut(far, far.sliding.any(axis=1), view.scale))
    removed, rest = free.removed(named.found[0], 0), free.leftover(0)
    assert removed > 10.0
    if power == 1:
        assert rest.foretold() < 1e-3 * removed
    else:
        assert rest.foretold() > removed / HALF_BELIEVED  # no name
