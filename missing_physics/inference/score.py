"""How well a hypothesis predicts what it was not fitted to.

Every block of rows is predicted by the fit to all others, blocks of held-out recordings by the fit to all
fitted ones. The log score of a hypothesis is that of Gaussian errors, of one variance at each joint:

    -1/2 sum_j a_j sum_b (n_bj log s_j^2 + e_bj^2 / s_j^2)

with the share a_j of samples that are independent, by the autocorrelation of the residual (Geyer 1992), and
the variance s_j^2 of all its errors there and of the model's own error. Errors of a real machine are not
white and not Gaussian: this coarsened likelihood (Miller and Dunson, J. American Statistical Association 114
(2019)) counts them for what they say, and leaves the estimates those of weighted least squares.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.inference.data import Data
from missing_physics.inference.fit import Fit, residuals

__all__ = ["block_scores", "independent_shares"]

Array = NDArray[np.float64]

#: Error of integrators, gears and sensors that no hypothesis explains, as a part of the recorded torque's
#: rms [-]: what lies below it says nothing of physics. A few thousandths are what torque sensors hold.
MODEL_ERROR = 3e-3


def block_scores(data: Data, fit: Fit, shares: Array) -> Array:
    """Log score of each block [nats], shape (B,)."""
    counts = data.counts
    total = np.maximum(counts.sum(axis=0), 1.0)
    own = (MODEL_ERROR * data.torque) ** 2
    variance = np.maximum(fit.errors.sum(axis=0) / total + own, 1e-300)
    each = -0.5 * shares * (counts * np.log(variance) + (fit.errors + own * counts) / variance)
    return np.asarray(np.where(counts.sum(axis=0) > 0.0, each, 0.0).sum(axis=1))


def independent_shares(data: Data, fit: Fit) -> Array:
    """Independent samples over samples of the residual of each joint, shape (n,)."""
    joints = fit.sigma.size
    longest = max(len(run.rows.time) for run in data.runs[: data.fitted])
    lags = np.zeros((longest // 2, joints))
    for i in range(data.fitted):
        left = residuals(data, fit, i)
        power = np.abs(np.fft.rfft(left, 2 * len(left), axis=0)) ** 2
        own = np.fft.irfft(power, axis=0)[: len(left) // 2]
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
