"""Spectra of residuals by octave, calibration of the score, and intervals of counted fractions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.stats import beta, f, norm

from missing_physics.evaluation.band import ORDER
from missing_physics.inference import Fit
from missing_physics.inference.data import Data
from missing_physics.inference.score import SCATTER, levels

__all__ = [
    "FEWEST",
    "Octave",
    "Series",
    "clopper_pearson",
    "deviates",
    "held_out_deviates",
    "held_out_ratios",
    "octaves",
    "scatter",
]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Fewest independent samples of an octave that is shown: the power of white noise is then known to a third.
FEWEST = 20


@dataclass(frozen=True)
class Series:
    """Residual of one joint in one recording, in the band.

    Attributes:
        values: zero where nothing is compared, shape (K,).
        counted: mask of the samples that are compared, shape (K,).
        step: time between samples [s].
        rate: samples per second before decimation [Hz], at which the band's filter ran.
        cutoff: end of the band [Hz].
    """

    values: Array
    counted: Mask
    step: float
    rate: float
    cutoff: float


@dataclass(frozen=True)
class Octave:
    """Power of a residual in one octave.

    Attributes:
        end: highest frequency [Hz].
        power: density relative to the mean over the band; one for white noise.
        samples: number of independent samples.
    """

    end: float
    power: float
    samples: float


def octaves(series: Sequence[Series]) -> list[Octave]:
    """Power by octave below the end of the band, highest first, without the response of the band's filter.

    The lowest one reaches down to zero, so that none has less than `FEWEST` samples.

    Args:
        series: of one joint in recordings with one band.
    """
    frequencies, powers, samples = [], [], []
    for one in series:
        count = int(one.counted.sum())
        if count < 2:
            continue
        found = np.arange(1, one.values.size // 2 + 1) / (one.values.size * one.step)
        power = np.abs(np.fft.rfft(one.values)[1 : found.size + 1]) ** 2 / count
        within = found <= one.cutoff
        frequencies.append(found[within])
        powers.append(power[within] / _response(one, found[within]))
        samples.append(np.full(int(within.sum()), 2.0 * count / one.values.size))
    if not frequencies:
        return []
    at, power, weight = map(np.concatenate, (frequencies, powers, samples))
    mean = float(np.average(power, weights=weight))
    found_octaves: list[Octave] = []
    end = series[0].cutoff
    while mean > 0.0 and weight[at <= end].sum() >= FEWEST:
        own = (at <= end) & (at > 0.5 * end)
        below = at <= 0.5 * end
        if weight[own].sum() < FEWEST or weight[below].sum() < FEWEST:
            own |= below
        share = float(np.average(power[own], weights=weight[own])) / mean
        found_octaves.append(Octave(end, share, float(weight[own].sum())))
        end = 0.5 * end if not (own & below).any() else 0.0
    return found_octaves


def scatter(found: Sequence[Octave]) -> float:
    """Mean square deviation of octaves from one relative to that of white noise; NaN for a single one."""
    total = sum(own.samples for own in found)
    if len(found) < 2:
        return float("nan")
    spread = [
        2.0 / own.samples * (1.0 - own.samples / total) for own in found
    ]  # the mean is that of all octaves
    return float(np.mean([(own.power - 1.0) ** 2 / s for own, s in zip(found, spread)]))


def _response(series: Series, frequencies: Array) -> Array:
    """Fraction of the power of white noise that passes the band's filter, forward and backward."""
    sections = signal.butter(ORDER, series.cutoff, fs=series.rate, output="sos")
    return np.asarray(np.abs(signal.sosfreqz(sections, frequencies, fs=series.rate)[1]) ** 4)


def deviates(square: Array, samples: Array, level: Array) -> Array:
    """Standard normal deviates of blocks' mean square errors, if the Student's t of the score is right.

    The mean square of m samples of a multivariate t, divided by its level, has an F distribution of m and
    `SCATTER` degrees of freedom.

    Args:
        square: mean square errors.
        samples: their numbers of independent samples, of the same shape or broadcast, positive.
        level: of the variance.
    """
    ratio = square / level
    below, above = f.cdf(ratio, samples, SCATTER), f.sf(ratio, samples, SCATTER)
    return np.asarray(np.where(below < 0.5, norm.ppf(below), norm.isf(above)))


def held_out_deviates(data: Data, fit: Fit, shares: Array) -> list[Array]:
    """`deviates` of the held-out blocks of each joint, with the level of the fitted blocks."""
    square = fit.errors / np.maximum(data.counts, 1.0) + data.error**2
    samples, fitted = shares * data.counts, data.fitted_blocks
    level = levels(square[fitted], samples[fitted])
    found = []
    for k in range(level.size):
        own = ~fitted & (samples[:, k] > 0.0)
        known = bool(samples[fitted, k].sum() > 0.0)
        found.append(deviates(square[own, k], samples[own, k], level[k]) if known else np.zeros(0))
    return found


def held_out_ratios(data: Data, fit: Fit) -> tuple[Array, Array]:
    """Mean square error of held-out rows of each joint, relative to two of fitted rows, shape (n,) each.

    The first is the residual of the fit, the second the error of a prediction without the row's fold. NaN
    where no row is held out.
    """
    fitted, counts = data.fitted_blocks, data.counts
    held = counts[~fitted].sum(axis=0)
    square = np.where(held > 0.0, fit.errors[~fitted].sum(axis=0) / np.maximum(held, 1.0), np.nan)
    own = fit.errors[fitted].sum(axis=0) / np.maximum(counts[fitted].sum(axis=0), 1.0)
    return square / fit.sigma**2, square / np.maximum(own, 1e-300)


def clopper_pearson(hits: int, trials: int) -> tuple[float, float]:
    """95 % interval of a probability (Clopper and Pearson 1934)."""
    low = float(beta.ppf(0.025, hits, trials - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, trials - hits)) if hits < trials else 1.0
    return low, high
