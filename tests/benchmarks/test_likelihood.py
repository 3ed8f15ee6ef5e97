"""Measures of the likelihood: spectra by octave, calibration of the score, plain least squares, coverage."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.yardstick.likelihood.__main__ import main
from benchmarks.yardstick.likelihood.fits import FitMeasures, Interval, fit_of
from benchmarks.yardstick.likelihood.least_squares import least_squares
from benchmarks.yardstick.likelihood.measures import Series, clopper_pearson, deviates, octaves, scatter
from missing_physics.evaluation.band import low_passed
from missing_physics.inference.score import SCATTER, levels

Array = NDArray[np.float64]

RATE, CUTOFF, STRIDE = 200.0, 4.0, 12
#: Fractions that intervals of 95 % may reach: those of approximate intervals, and of cautious ones.
LOWEST, HIGHEST = 0.90, 0.98


def white(random: np.random.Generator, count: int) -> Array:
    return random.standard_normal(count)


def drifting(random: np.random.Generator, count: int) -> Array:
    """First-order low-passed noise with a time constant of 0.5 s, far below the end of the band."""
    found, kept = np.zeros(count), np.exp(-2.0 / RATE)
    for k, value in enumerate(white(random, count)):
        found[k] = kept * found[k - 1] + value
    return found


def series(made: Callable[[np.random.Generator, int], Array], seed: int) -> Series:
    """Noise in the band as rows are, one fifth of it not compared."""
    values = low_passed(made(np.random.default_rng(seed), 12_000), rate=RATE, cutoff=CUTOFF)[::STRIDE]
    counted = np.arange(values.size) % 100 >= 20
    return Series(np.where(counted, values, 0.0), counted, STRIDE / RATE, RATE, CUTOFF)


def test_octaves_of_white_noise_are_flat() -> None:
    found = [octaves([series(white, seed)]) for seed in range(40)]
    assert {len(one) for one in found} == {5}
    means = np.mean([[own.power for own in one] for one in found], axis=0)
    assert np.allclose(means, 1.0, atol=0.15)
    assert np.mean([scatter(one) for one in found]) == pytest.approx(1.0, abs=0.25)


def test_octaves_of_a_drift_are_not_flat() -> None:
    powers = [own.power for own in octaves([series(drifting, 1)])]
    assert powers[0] < 0.5
    assert powers[-1] > 3.0
    assert scatter(octaves([series(drifting, 1)])) > 20.0


def test_deviates_of_draws_from_the_model_have_mean_square_one() -> None:
    """Blocks of some samples with one variance each, drawn as the score supposes; the level is estimated."""
    random = np.random.default_rng(2)
    samples = np.repeat(np.array([[1.0], [4.0], [12.0]]), 4000, axis=0)
    variance = 9.0 * SCATTER / random.chisquare(SCATTER, samples.shape)
    square = variance * random.chisquare(samples) / samples
    level = levels(square, samples)
    assert level == pytest.approx(9.0, rel=0.05)
    found = deviates(square, samples, level)
    assert np.mean(found**2) == pytest.approx(1.0, abs=0.05)
    assert np.mean(found) == pytest.approx(0.0, abs=0.05)
    assert np.mean(deviates(30.0 * square, samples, level) ** 2) > 2.0


def test_deviates_of_one_variance_are_small() -> None:
    """The score allows a scatter of the variance; where there is none, it is cautious."""
    random = np.random.default_rng(3)
    samples = np.full((4000, 1), 20.0)
    square = random.chisquare(20.0, samples.shape) / 20.0
    assert np.mean(deviates(square, samples, levels(square, samples)) ** 2) < 0.3


def test_plain_least_squares_covers_the_truth_and_drops_what_rows_do_not_determine() -> None:
    hits = []
    for seed in range(60):
        random = np.random.default_rng(seed)
        design = random.standard_normal((400, 2, 4))
        design[:, :, 3] = design[:, :, 2]  # only the sum of both is determined
        noise = random.standard_normal((400, 2)) * [1.0, 3.0]
        truth = np.array([1.0, -2.0, 3.0, 0.0])
        every = np.ones((400, 2), dtype=bool)
        found = least_squares(design, design @ truth + noise, every, np.ones(2), np.full(4, 5.0))
        assert np.isnan(found.deviations[2:]).all()
        assert found.sigma == pytest.approx([1.0, 3.0], rel=0.15)
        hits += list(np.abs(found.values - truth)[:2] < 1.96 * found.deviations[:2])
    low, high = clopper_pearson(sum(hits), len(hits))
    assert low < 0.95 < high


def test_interval_of_a_fraction_is_that_of_clopper_and_pearson() -> None:
    assert clopper_pearson(0, 10) == pytest.approx((0.0, 0.3085), abs=1e-4)
    assert clopper_pearson(8, 10) == pytest.approx((0.4439, 0.9748), abs=1e-4)


def test_page_has_a_row_for_every_kind_of_parameter(tmp_path) -> None:  # type: ignore[no-untyped-def]
    main(["--machines", "--fits", "2", "--out", str(tmp_path / "page.md")])
    page = (tmp_path / "page.md").read_text("utf-8")
    assert "| `cable_spring` | stiffness |" in page
    assert "Coverage over 2 simulated fits" in page


@pytest.fixture(scope="module")
def hundred() -> list[FitMeasures]:
    return [fit_of(number) for number in range(1000, 1100)]


def covers(own: list[Interval]) -> bool:
    """Whether the fraction of intervals with the truth may be one of those of intervals of 95 %."""
    low, high = clopper_pearson(sum(one.contains for one in own), len(own))
    return low <= HIGHEST and high >= LOWEST


@pytest.mark.proof
def test_intervals_contain_the_truth_as_often_as_they_state(hundred: list[FitMeasures]) -> None:
    every = [one for fit in hundred for one in (*fit.of_effect, *fit.of_standard)]
    for name in sorted({one.name for one in every}):
        assert covers([one for one in every if one.name == name]), name
    assert covers(every)


@pytest.mark.proof
def test_residual_of_the_true_hypothesis_is_white_noise(hundred: list[FitMeasures]) -> None:
    spectra = [found for fit in hundred for found in fit.octaves if len(found) > 1]
    assert np.mean([scatter(found) for found in spectra]) == pytest.approx(1.0, abs=0.35)
    assert np.median([r for fit in hundred for r in fit.over_noise]) == pytest.approx(1.0, abs=0.1)
    assert np.median([r for fit in hundred for r in fit.foreseen]) == pytest.approx(1.0, abs=0.2)
