"""Regression in blocks: against plain linear algebra, closed forms and Monte Carlo."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special, stats
from scipy.signal import lfilter

from missing_physics.diagnosis.statistics.correlated_errors import (
    FOLDS,
    BlockedRegression,
    effective_samples,
    paired_block_p_value,
)

Array = NDArray[np.float64]
#: Normal equations lose half the digits of columns whose condition number is about 10.
DIGITS = 1e-7


def ar1(chance: np.random.Generator, shape: tuple[int, ...], rho: float) -> Array:
    """AR(1) series of unit variance along the first axis, stationary from the start."""
    white = chance.standard_normal(shape)
    white[0] /= np.sqrt(1 - rho**2)
    return np.asarray(lfilter([np.sqrt(1 - rho**2)], [1.0, -rho], white, axis=0))


@pytest.fixture
def data() -> tuple[Array, Array, NDArray[np.int_]]:
    """Correlated columns of very different lengths, blocks of unequal size."""
    chance = np.random.default_rng(1)
    x = chance.standard_normal((600, 4)) @ (np.eye(4) + 0.5) * np.array([1.0, 1e4, 1e-3, 30.0])
    y = x @ np.array([2.0, -1e-4, 5e3, 0.1]) + chance.standard_normal(600)
    blocks = np.sort(chance.integers(0, 24, 600))
    return x, y, blocks


def test_solution_and_residual_are_those_of_least_squares(
    data: tuple[Array, Array, NDArray[np.int_]],
) -> None:
    x, y, blocks = data
    wanted, left, *_ = np.linalg.lstsq(x, y, rcond=None)
    found = BlockedRegression.of(x, y, blocks)
    np.testing.assert_allclose(found.solution(), wanted, rtol=DIGITS)
    assert found.residual_energy() == pytest.approx(left[0], rel=DIGITS)
    energies = found.block_energy(found.scaled_solution())
    errors = (y - x @ wanted) ** 2
    np.testing.assert_allclose(energies, np.bincount(blocks, errors)[np.unique(blocks)], rtol=1e-5)


def test_taking_columns_is_regressing_on_them_alone(data: tuple[Array, Array, NDArray[np.int_]]) -> None:
    x, y, blocks = data
    chosen = np.array([3, 0])
    taken = BlockedRegression.of(x, y, blocks).take(chosen)
    np.testing.assert_allclose(taken.solution(), np.linalg.lstsq(x[:, chosen], y, rcond=None)[0], rtol=DIGITS)


def test_holding_coefficients_is_regressing_on_what_they_leave(
    data: tuple[Array, Array, NDArray[np.int_]],
) -> None:
    x, y, blocks = data
    values = np.array([0.7, -1.3])
    held = BlockedRegression.of(x, y, blocks).held(np.array([2, 0]), values)
    others = np.setdiff1d(np.arange(x.shape[1]), [0, 2])
    rest = BlockedRegression.of(x[:, others], y - x[:, [2, 0]] @ values, blocks)
    np.testing.assert_allclose(held.solution(), rest.solution(), rtol=DIGITS)
    np.testing.assert_allclose(held.energy, rest.energy, rtol=DIGITS)
    np.testing.assert_allclose(held.held_out_energy(), rest.held_out_energy(), rtol=DIGITS)


def test_a_prior_is_a_ridge_in_the_units_of_the_coefficients(
    data: tuple[Array, Array, NDArray[np.int_]],
) -> None:
    x, y, blocks = data
    prior = np.array([10.0, 1e9, 0.0, 1e5])
    wanted = np.linalg.solve(x.T @ x + np.diag(prior), x.T @ y)
    found = BlockedRegression.of(x, y, blocks, prior=prior)
    np.testing.assert_allclose(found.solution(), wanted, rtol=DIGITS)
    np.testing.assert_allclose(
        found.take(np.array([1, 3])).solution(),
        np.linalg.solve((x.T @ x + np.diag(prior))[np.ix_([1, 3], [1, 3])], (x.T @ y)[[1, 3]]),
        rtol=DIGITS,
    )


@pytest.mark.parametrize("alternate", [False, True])
def test_held_out_energy_is_that_of_explicit_refits(
    data: tuple[Array, Array, NDArray[np.int_]], alternate: bool
) -> None:
    x, y, blocks = data
    labels = np.unique(blocks)
    order = np.arange(labels.size)
    fold = order % 2 if alternate else order * FOLDS // labels.size
    wanted = np.empty(labels.size)
    for number in np.unique(fold):
        out = np.isin(blocks, labels[fold == number])
        beta = np.linalg.lstsq(x[~out], y[~out], rcond=None)[0]
        errors = np.where(out, (y - x @ beta) ** 2, 0.0)
        for place in np.flatnonzero(fold == number):
            wanted[place] = errors[blocks == labels[place]].sum()
    found = BlockedRegression.of(x, y, blocks, alternate=alternate).held_out_energy()
    np.testing.assert_allclose(found, wanted, rtol=1e-5)
    assert found.sum() > BlockedRegression.of(x, y, blocks).residual_energy()


def test_covariance_is_that_of_explicit_refits_without_each_block(
    data: tuple[Array, Array, NDArray[np.int_]],
) -> None:
    x, y, blocks = data
    whole = np.linalg.lstsq(x, y, rcond=None)[0]
    labels = np.unique(blocks)
    wanted = np.zeros((4, 4))
    for label in labels:
        change = np.linalg.lstsq(x[blocks != label], y[blocks != label], rcond=None)[0] - whole
        wanted += np.outer(change, change) * (labels.size - 1) / labels.size
    found = BlockedRegression.of(x, y, blocks).covariance()
    size = np.sqrt(np.diagonal(wanted))
    np.testing.assert_allclose(found / np.outer(size, size), wanted / np.outer(size, size), atol=1e-5)


def test_the_sandwich_is_that_of_liang_and_zeger(data: tuple[Array, Array, NDArray[np.int_]]) -> None:
    x, y, blocks = data
    errors = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    bread = np.linalg.inv(x.T @ x)
    meat = np.zeros((4, 4))
    for label in np.unique(blocks):
        score = x[blocks == label].T @ errors[blocks == label]
        meat += np.outer(score, score)
    groups = np.unique(blocks).size
    wanted = bread @ meat @ bread * groups / (groups - 1)
    found = BlockedRegression.of(x, y, blocks).sandwich()
    size = np.sqrt(np.diagonal(wanted))
    np.testing.assert_allclose(found / np.outer(size, size), wanted / np.outer(size, size), atol=1e-5)


def test_freedom_counts_the_blocks_that_tell_a_coefficient() -> None:
    blocks = np.repeat(np.arange(30), 20)
    x = np.ones((600, 2))
    x[:, 1] = np.where(blocks % 10 == 0, np.tile([1.0, -1.0], 300), 0.0)
    found = BlockedRegression.of(x, np.zeros(600), blocks).freedom(np.array([[1.0, 0.0], [0.0, 1e3]]))
    np.testing.assert_allclose(found, [29.0, 2.0], rtol=1e-6)


def test_intervals_cover_among_many_coefficients_determined_by_few_blocks() -> None:
    """Twelve coefficients that remember, one told by four of 48 blocks: the sandwich covers 79 % there."""
    chance, draws, groups, size = np.random.default_rng(8), 300, 48, 12
    blocks = np.repeat(np.arange(groups), 40)
    hits = np.zeros(size)
    for _ in range(draws):
        x, e = ar1(chance, (blocks.size, size), 0.95), ar1(chance, (blocks.size,), 0.7)
        x[:, 1] *= blocks % 12 == 0
        fit = BlockedRegression.of(x, e, blocks)
        half = stats.t.ppf(0.975, fit.freedom(np.eye(size))) * np.sqrt(np.diagonal(fit.covariance()))
        hits += np.abs(fit.solution()) <= half
    # 95 % of 300 draws scatters by 1.3 %; over eleven coefficients by half of that at most.
    assert hits[1] / draws > 0.92
    assert 0.93 < np.delete(hits, 1).mean() / draws < 0.975


def test_intervals_cover_although_errors_remember() -> None:
    """AR(1) errors along an AR(1) regressor: formulas for white errors cover far too rarely."""
    chance, draws, rows, groups, rho = np.random.default_rng(2), 400, 1500, 30, 0.93
    blocks = np.repeat(np.arange(groups), rows // groups)
    x, e = ar1(chance, (rows, draws), rho), ar1(chance, (rows, draws), rho)
    hits, naive = 0, 0
    for k in range(draws):
        column = x[:, k : k + 1]
        fit = BlockedRegression.of(column, 3.0 * column[:, 0] + e[:, k], blocks)
        miss = abs(fit.solution()[0] - 3.0)
        freedom = fit.freedom(np.eye(1))[0]
        hits += miss <= stats.t.ppf(0.975, freedom) * np.sqrt(fit.covariance()[0, 0])
        naive += miss <= 1.96 * np.sqrt(fit.residual_energy() / rows / (column**2).sum())
    # 95 % of 400 has a standard deviation of 1.1 %; 30 blocks cost another 2 %.
    assert 0.91 <= hits / draws <= 0.98
    assert naive / draws < 0.75


def test_wald_p_values_are_uniform_when_nothing_is_there_and_small_when_something_is() -> None:
    chance, draws, rows, groups = np.random.default_rng(3), 400, 1200, 30
    blocks = np.repeat(np.arange(groups), rows // groups)
    values = []
    for _ in range(draws):
        x, e = ar1(chance, (rows, 3), 0.8), ar1(chance, (rows,), 0.8)
        fit = BlockedRegression.of(x, 0.7 * x[:, 0] + e, blocks)
        values.append(fit.wald_p_value(np.array([1, 2])))
    # Kolmogorov and Smirnov at 400 draws see a shift of 8 %; a 5 % test may err by 2.2 % twice.
    assert stats.kstest(values, "uniform").pvalue > 1e-3
    assert np.mean(np.array(values) < 0.05) < 0.095
    assert fit.wald_p_value(np.array([0])) < 1e-4


@pytest.mark.parametrize("groups", [5, 9])
def test_one_coefficient_is_tested_by_students_t_of_the_blocks_less_one(groups: int) -> None:
    chance = np.random.default_rng(groups)
    x, e = chance.standard_normal((20 * groups, 1)), chance.standard_normal(20 * groups)
    fit = BlockedRegression.of(x, 0.05 * x[:, 0] + e, np.repeat(np.arange(groups), 20))
    departure = abs(fit.solution()[0]) / np.sqrt(fit.covariance()[0, 0])
    wanted = 2.0 * stats.t.sf(departure, groups - 1)
    assert fit.wald_p_value(np.array([0])) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("tested", [2, 3])
def test_several_coefficients_are_tested_by_hotellings_law_of_few_blocks(tested: int) -> None:
    """T^2 (G - m) / (m (G - 1)) is F of m and G - m degrees of freedom (Hotelling, 1931), G the blocks."""
    groups = 7
    chance = np.random.default_rng(tested)
    x, e = chance.standard_normal((20 * groups, 4)), chance.standard_normal(20 * groups)
    fit = BlockedRegression.of(x, x @ np.full(4, 0.1) + e, np.repeat(np.arange(groups), 20))
    own = np.arange(1, 1 + tested)
    departure = fit.solution()[own]
    squared = departure @ np.linalg.solve(fit.covariance()[np.ix_(own, own)], departure)
    # the integral of F's density, by its regularised incomplete beta function
    freedom = groups - tested
    share = freedom / (freedom + squared * freedom / (groups - 1))
    wanted = special.betainc(freedom / 2, tested / 2, share)
    assert fit.wald_p_value(own) == pytest.approx(wanted, rel=1e-6)
    assert fit.wald_p_value(own) > 2.0 * stats.chi2.sf(squared, tested)  # which few blocks do not bear out


def test_where_nothing_is_tested_nothing_departs() -> None:
    x = np.ones((40, 1))
    regression = BlockedRegression.of(x, x[:, 0], np.repeat(np.arange(10), 4))
    assert regression.wald_p_value(np.zeros(0, dtype=int)) == 1.0


def test_too_few_blocks_prove_nothing() -> None:
    x = np.arange(20.0)[:, None]
    fit = BlockedRegression.of(x, 5 * x[:, 0], np.repeat([0, 1], 10))
    assert fit.wald_p_value(np.array([0])) == 1.0


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9, 0.97])
def test_effective_samples_of_ar1_have_a_closed_form(rho: float) -> None:
    """N over the sum of squared correlations: N (1 - rho^2)/(1 + rho^2)."""
    chance, size = np.random.default_rng(5), 20000
    found = np.mean([effective_samples(ar1(chance, (size,), rho)) for _ in range(8)])
    ratio = found / (size * (1 - rho**2) / (1 + rho**2))
    # The sum over a tenth of all lags also counts the chance correlations of a series with memory, 20 % of
    # that memory (Bartlett); what is taken away is that of white noise. So it errs to the cautious side.
    assert 1 / 1.25 < ratio < 1.05


def test_effective_samples_of_what_has_no_memory_to_measure() -> None:
    assert effective_samples(np.ones(100)) == 100
    assert effective_samples(np.arange(10.0)) == 10


def test_block_bootstrap_gives_the_normal_tail() -> None:
    chance = np.random.default_rng(6)
    gain = chance.standard_normal(60)
    gain += 0.2 - gain.mean()
    wanted = stats.norm.sf(0.2 * np.sqrt(60) / gain.std())
    # 20000 draws scatter by 0.002; the normal law is off by about 0.01 for 60 blocks.
    before = np.full(60, 10.0)
    assert paired_block_p_value(before, before - gain, draws=20000) == pytest.approx(wanted, abs=0.015)


def test_block_bootstrap_at_its_ends() -> None:
    ones = np.ones(30)
    assert paired_block_p_value(2 * ones, ones, draws=999) == pytest.approx(1e-3)
    assert paired_block_p_value(ones, 2 * ones) == 1.0
    assert paired_block_p_value(ones, ones) == 1.0
    assert paired_block_p_value(np.array([2.0, 2.0]), np.array([1.0, 1.5])) == 0.0
    assert paired_block_p_value(np.array([1.0, 2.0]), np.array([2.0, 2.5])) == 1.0
    chance = np.random.default_rng(7)
    a, b = chance.random(20), chance.random(20)
    assert paired_block_p_value(a, b, seed=1) == paired_block_p_value(a, b, seed=1)
