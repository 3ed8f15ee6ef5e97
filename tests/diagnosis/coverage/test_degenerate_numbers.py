"""Numbers that make nothing of what is divided by them: zero, next to zero, and beyond all bounds."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
import pytest
from diagnosis_cases import ARM, bare, recorded

from missing_physics.diagnosis.coverage.needs import Needs
from missing_physics.diagnosis.dynamics.recorded import make_dynamics
from missing_physics.diagnosis.statistics.correlated_errors import BlockedRegression, effective_samples
from missing_physics.recordings.inspection.units import position_per_velocity

ROBOT = bare("two_link_arm", noise=True)


@pytest.fixture(autouse=True)
def warnings_are_errors() -> Iterator[None]:
    """Those that NumPy attributes to its own modules as well."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def test_the_memory_of_a_series_does_not_depend_on_its_size() -> None:
    series = np.convolve(np.random.default_rng(0).standard_normal(500), np.ones(9), mode="same")
    usual = effective_samples(series)
    for size in (1e-170, 1e-200, 1e150):
        assert effective_samples(size * series) == pytest.approx(usual)
    assert effective_samples(0.0 * series) == 500.0


def test_a_column_of_next_to_nothing_has_a_coefficient_with_a_deviation() -> None:
    chance = np.random.default_rng(1)
    columns = chance.standard_normal((400, 2)) * [1.0, 1e-156]
    blocks = np.arange(400) // 40
    regression = BlockedRegression.of(columns, columns[:, 0] + chance.standard_normal(400), blocks)
    assert np.isfinite(regression.covariance()).all()


def test_an_exact_fit_leaves_nothing_and_rounding_does_not_make_it_less() -> None:
    blocks = np.arange(400) // 40
    left = []
    for seed in range(20):
        columns = np.random.default_rng(seed).standard_normal((400, 2))
        regression = BlockedRegression.of(columns, columns @ [3.0, -2.0], blocks)
        left.append(regression.held_out_energy().sum())
        assert abs(left[-1]) < 400 * 1e-12
    assert min(left) < 0.0  # or this shows nothing


def test_a_constant_torque_leaves_nothing_to_explain() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    flat = made.with_channels({"joint1.torque": np.full(len(made), 3.7)})
    needs = Needs.of(make_dynamics(ROBOT, [flat])[0])
    assert needs.left(0, (0.1, 10.0)) == 0.0
    assert needs.left(1, (0.1, 10.0)) < 0.1


@pytest.mark.parametrize("size", [1e-100, 1.0, 1e100])
def test_ratios_of_small_and_large_numbers(size: float) -> None:
    time = np.arange(2000) / 100.0
    ratio, alike = position_per_velocity(time, size * np.sin(time), size * np.cos(time))
    assert ratio == pytest.approx(1.0, rel=1e-3)
    assert alike == pytest.approx(1.0, rel=1e-3)
