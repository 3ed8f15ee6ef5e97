"""Score of a hypothesis on data to which it was not fitted.

Every block of rows is predicted by the fit to all other folds, held-out blocks by the fit to all folds.
Errors of a block are Gaussian with a variance that scatters about one level s_j^2 of each joint, since models
err more in some poses than in others. Together this is a multivariate Student's t,

    -sum_j sum_b (m_bj / 2 log s_j^2 + (nu + m_bj) / 2 log(1 + m_bj r_bj / (nu s_j^2)))

with the mean square error r_bj of the block and its number m_bj = a_j n_bj of independent samples, where a_j
follows from the autocorrelation of the residual (Geyer 1992). r_bj includes the error of any model. Samples
of the torque in saturation cannot be predicted; their density is a Gaussian with the torque's rms. Errors of
a real machine are not white. This coarsened likelihood (Miller and Dunson, J. American Statistical
Association 114 (2019)) weighs them by their information, and the estimates remain those of weighted least
squares.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.inference.data import Data
from missing_physics.inference.fit import Fit, residuals

__all__ = ["SCATTER", "block_scores", "independent_shares", "levels", "unpredicted"]

Array = NDArray[np.float64]

#: Degrees of freedom of the scatter of the variance between blocks [-]: its standard deviation is about equal
#: to its mean.
SCATTER = 4.0
#: Rounds of estimating the level; it changes by less than a thousandth in the last one.
ROUNDS = 12


def block_scores(data: Data, fit: Fit, shares: Array) -> Array:
    """Log score of each block [nats], shape (B,)."""
    counts, own = data.counts, data.error**2
    square = fit.errors / np.maximum(counts, 1.0) + own
    samples = shares * counts
    level = levels(square, samples)
    apart = np.log1p(samples * square / (SCATTER * level))
    each = -0.5 * samples * np.log(level) - 0.5 * (SCATTER + samples) * apart
    each -= unpredicted(shares * fit.cut, data.size, level)
    return np.asarray(np.where(samples > 0.0, each, 0.0).sum(axis=1))


def levels(square: Array, samples: Array) -> Array:
    """Level s_j^2 of the variance of each joint at the maximum of the likelihood, shape (n,).

    Args:
        square: mean square error of each block, shape (B, n).
        samples: number of independent ones, shape (B, n).
    """
    total = np.maximum(samples.sum(axis=0), 1e-300)
    level = np.maximum((samples * square).sum(axis=0) / total, 1e-300)
    for _ in range(ROUNDS):  # iterate weights and level of the t
        weight = (SCATTER + samples) / (SCATTER + samples * square / level)
        level = np.maximum((weight * samples * square).sum(axis=0) / total, 1e-300)
    return np.asarray(level)


def unpredicted(samples: Array, size: Array, level: Array) -> Array:
    """Loss of log score by samples of a torque that cannot be predicted [nats].

    Args:
        samples: number of independent ones at each joint, shape (..., n).
        size: rms of the torque, shape (n,).
        level: mean square of the errors of others, shape (n,).
    """
    return np.asarray(0.5 * samples * (np.log(np.maximum(size**2 / level, 1.0)) + 1.0))


def independent_shares(data: Data, fit: Fit) -> Array:
    """Ratio of independent samples to samples in the residual of each joint, shape (n,)."""
    joints = fit.sigma.size
    longest = max(data.time(i).size for i in range(data.fitted))
    lags = np.zeros((longest // 2, joints))
    for i in range(data.fitted):
        residual = residuals(data, fit, i)
        power = np.abs(np.fft.rfft(residual, 2 * len(residual), axis=0)) ** 2
        own = np.fft.irfft(power, axis=0)[: len(residual) // 2]
        lags[: len(own)] += own
    found = np.ones(joints)
    for k in range(joints):
        if len(lags) < 2 or lags[0, k] <= 0.0:
            continue
        rho = lags[:, k] / lags[0, k]
        pairs = rho[: rho.size // 2 * 2].reshape(-1, 2).sum(axis=1)
        ends = np.flatnonzero(pairs <= 0.0)
        initial = pairs[: ends[0]] if ends.size else pairs
        found[k] = 1.0 / max(2.0 * float(initial.sum()) - 1.0, 1.0)
    return found
