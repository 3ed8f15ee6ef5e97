"""Spectra, whitening and evidence against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from missing_physics.likelihood.bands import Bands, Spectrum
from missing_physics.likelihood.evidence import JointSums, ModelError, Prior, posterior, predictive
from missing_physics.likelihood.gram import Gram, Whitener
from missing_physics.likelihood.weights import unsure

EXACT = [ModelError(bodies=1e9, laws=1e9, floor=0.0)]


def coloured(samples: int, rate: float, seed: int) -> tuple[np.ndarray, Spectrum]:
    """A first-order process of ten samples' memory, and its spectrum."""
    keep = np.exp(-0.1)
    white = np.random.default_rng(seed).standard_normal(samples)
    bands = Bands.of(samples / rate, rate)
    turn = np.exp(-2j * np.pi * bands.centres / rate)
    return lfilter([1.0], [1.0, -keep], white), Spectrum(bands, np.abs(1.0 / (1.0 - keep * turn)) ** 2)


def test_bands_cover_every_bin_once() -> None:
    for samples in (100, 1001, 4096):
        parts = Bands.of(samples / 50.0, 50.0).parts(samples, 50.0)
        assert [i for p in parts for i in range(p.start, p.stop)] == list(range(samples // 2 + 1))


def test_a_whitened_process_is_white_in_every_band() -> None:
    series, spectrum = coloured(40000, 100.0, 0)
    whitener = Whitener(spectrum, np.ones(series.size), 100.0)
    gram = Gram.of(whitener, series[:, None])
    power = gram.products[:, 0, 0].real / gram.count
    # A band of n bins scatters by 1/sqrt(n); four of that, and what a piecewise linear spectrum costs.
    assert np.all(np.abs(power - 1.0) < 4.0 / np.sqrt(gram.count) + 0.05)


def test_the_whitening_filter_is_causal() -> None:
    """A pulse changes nothing before it."""
    _, spectrum = coloured(2000, 100.0, 0)
    pulse = np.zeros((2000, 1))
    pulse[1500] = 1.0
    white = Whitener(spectrum, np.ones(2000), 100.0).series(pulse)[:, 0]
    assert np.abs(white[: white.size - 500]).max() < 1e-6 * np.abs(white).max()


def sums(columns: np.ndarray, places: np.ndarray, spectrum: Spectrum) -> JointSums:
    gram = Gram.of(Whitener(spectrum, np.ones(len(columns)), 100.0), columns)
    law = np.ones(columns.shape[1] - 1, dtype=bool)
    inner = places.size
    return JointSums(gram, places, spectrum.bands.centres, law[inner:], law[:inner])


def test_evidence_is_that_of_the_exact_gaussian_integral() -> None:
    """With levels at the reference: log N(z; 0, 1 + X P X') of whitened residuals, bin by bin."""
    series, spectrum = coloured(400, 100.0, 1)
    chance = np.random.default_rng(2)
    regressors = np.column_stack([np.ones(400), np.linspace(-1, 1, 400), chance.standard_normal(400)])
    width, away = np.array([2.0, 1.0, 0.5]), np.array([0.3, 0.0, -0.2])
    joint = sums(np.column_stack([series + 0.7, regressors]), np.arange(3), spectrum)
    found = posterior([joint], Prior.gaussian(width, away), EXACT)
    level = found.levels[0]
    spectra = Whitener(spectrum, np.ones(400), 100.0).spectra(np.column_stack([series + 0.7, regressors]))
    spectra[[0, -1]] *= np.sqrt(0.5)
    parts = spectrum.bands.parts(2 * (len(spectra) - 1), 100.0)
    scale = np.concatenate([np.full(p.stop - p.start, v) for p, v in zip(parts, level)])[:, None]
    real = np.sqrt(2.0) * np.concatenate([(spectra / np.sqrt(scale)).real, (spectra / np.sqrt(scale)).imag])
    z, x = real[:, 0], real[:, 1:]
    covariance = np.eye(len(z)) + (x * width**2) @ x.T
    difference = z - x @ away
    exact = -0.5 * (difference @ np.linalg.solve(covariance, difference) + np.linalg.slogdet(covariance)[1])
    count = joint.gram.count
    exact -= float(np.sum(count * np.log(level)) + np.sum(np.log(level) + 1.0 / level))
    assert found.log_evidence == pytest.approx(exact, abs=1e-6)


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """400 draws of two parameters in coloured noise: 95 % intervals hold 90 to 98 %."""
    held = 0
    time = np.arange(2000) / 100.0
    regressors = np.column_stack([np.sin(2 * np.pi * 0.7 * time), np.sign(np.sin(2 * np.pi * 0.3 * time))])
    for seed in range(200):
        series, spectrum = coloured(2000, 100.0, seed)
        rough = Spectrum(spectrum.bands, spectrum.power * np.linspace(0.5, 2.0, spectrum.bands.count))
        truth = np.random.default_rng(seed).normal(0.0, 3.0, 2)
        joint = sums(np.column_stack([series + regressors @ truth, regressors]), np.arange(2), rough)
        found = posterior([joint], Prior.gaussian(np.full(2, 3.0), np.zeros(2)), EXACT)
        held += int(np.sum(np.abs(found.mean - truth) < 1.96 * np.sqrt(np.diag(found.covariance))))
    assert 0.90 <= held / 400 <= 0.98


def test_a_model_that_is_wrong_above_a_corner_is_fitted_below_it() -> None:
    """A square wave of which the true force has no sharp edges: its size comes out right all the same."""
    rate, samples = 200.0, 8000
    time = np.arange(samples) / rate
    column = np.sign(np.sin(2 * np.pi * 0.4 * time))
    true = lfilter([0.06], [1.0, -0.94], column)  # a low-pass of 2 Hz
    chance = np.random.default_rng(5)
    bands = Bands.of(samples / rate, rate)
    noise = 1e-2 * chance.standard_normal(samples)
    joint = sums(
        np.column_stack([5.0 * true + noise, column, 5.0 * column]),
        np.arange(1),
        Spectrum(bands, np.full(bands.count, 1e-4)),
    )
    prior = Prior.gaussian(np.array([10.0]), np.zeros(1))
    exact = posterior([joint], prior, EXACT)
    corners = (0.5, 1.0, 2.0, 4.0, 8.0)
    wary = {corner: posterior([joint], prior, [ModelError(1e9, corner)]) for corner in corners}
    best = max(corners, key=lambda corner: wary[corner].log_evidence)
    assert best in (1.0, 2.0)
    # At the fundamental the lag takes 4 % of the amplitude, which no frequency tells from a smaller force.
    assert abs(wary[best].mean[0] - 5.0) < 0.06 * 5.0
    assert abs(exact.mean[0] - 5.0) > 1.0


def test_the_predictive_density_is_the_ratio_of_two_evidences() -> None:
    """p(b | a) = p(a, b) / p(a), levels held."""
    series, spectrum = coloured(4000, 100.0, 7)
    column = np.sin(np.arange(4000) / 30.0)
    prior = Prior.gaussian(np.array([2.0]), np.zeros(1))
    whole = np.column_stack([series + column, column])
    first, second = (sums(part, np.arange(1), spectrum) for part in (whole[:2000], whole[2000:]))
    if first.frequency.size == second.frequency.size:
        known = posterior([first], prior, EXACT)
        gram = 2.0 * second.without_error(EXACT[0], known.levels[0])[0].sum(axis=0)
        variance = known.covariance[0, 0]
        slope = gram[1, 0] - gram[1, 1] * known.mean[0]
        energy = 0.5 * (gram[0, 0] - 2 * gram[0, 1] * known.mean[0] + gram[1, 1] * known.mean[0] ** 2)
        exact = -float(np.sum(second.gram.count * np.log(known.levels[0]))) - energy
        exact += 0.5 * slope**2 / (1 / variance + gram[1, 1]) - 0.5 * np.log(1 + variance * gram[1, 1])
        assert predictive([second], known, EXACT) == pytest.approx(exact, rel=1e-9)


def test_samples_about_reversals_are_found_to_be_unsure() -> None:
    chance = np.random.default_rng(8)
    velocity = np.sin(np.arange(20000) / 200.0)
    spread = np.sqrt(1.0 + 30.0 * np.exp(-((velocity / 0.03) ** 2)))
    found = unsure([chance.standard_normal(20000) * spread], [velocity])
    assert found.speed == pytest.approx(0.03)
    assert 10.0 <= found.excess <= 100.0
    assert unsure([chance.standard_normal(20000)], [velocity]).excess <= 1.0
