"""Plain weighted least squares of the standard model, as practitioners do it, for comparison.

Essential base parameters by truncated singular values; no prior, no bounds, no constraint on the bodies
(IDIM-WLS; Gautier, ICRA 1997). Every joint is weighted by the rms of its residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Plain", "least_squares"]

Array = NDArray[np.float64]

#: Rounds of reweighting; weights change by less than a hundredth in the last one.
ROUNDS = 4
#: Norm of the change of the weighted torques, for a change of the parameters by their sizes, below which a
#: direction is not essential [-]: it is then as uncertain as the parameters are large.
ESSENTIAL = 1.0
#: Largest part of a determined parameter in directions that are not essential [-].
DETERMINED = 0.01


@dataclass(frozen=True)
class Plain:
    """A weighted least-squares fit.

    Attributes:
        values: estimates, zero in directions that are not essential, shape (X,).
        deviations: standard deviations, shape (X,); NaN for parameters that the rows do not determine.
        sigma: rms residual of each joint, shape (n,).
    """

    values: Array
    deviations: Array
    sigma: Array


def least_squares(
    design: Array, torque: Array, counted: NDArray[np.bool_], shares: Array, size: Array
) -> Plain:
    """Fit rows of several joints.

    Args:
        design: derivatives of the torques by the parameters, shape (K, n, X).
        torque: shape (K, n).
        counted: mask of the rows that are fitted, shape (K, n).
        shares: ratio of independent samples to samples at each joint, shape (n,), for the covariance.
        size: scale of each parameter, shape (X,).
    """
    joints = [np.flatnonzero(counted[:, k]) for k in range(torque.shape[1])]
    parts = [(design[rows, k] * size, torque[rows, k]) for k, rows in enumerate(joints)]
    values = np.zeros(design.shape[2])
    sigma = _residual_rms(parts, values)
    for _ in range(ROUNDS):
        whole = np.concatenate([own / s for (own, _), s in zip(parts, sigma)])
        aim = np.concatenate([target / s for (_, target), s in zip(parts, sigma)])
        left, singular, right = np.linalg.svd(whole, full_matrices=False)
        kept = singular > ESSENTIAL
        inverse = right[kept].T / singular[kept]
        values = inverse @ (left[:, kept].T @ aim)
        sigma = _residual_rms(parts, values)
    spread = inverse @ inverse.T
    variance = 1.0 - np.sum(right[kept] ** 2, axis=0)
    determined = variance < DETERMINED
    for (own, _), s, share in zip(parts, sigma, shares):
        variance += np.einsum("xy,yx->x", spread @ (own.T @ own), spread) / (s**2 * share)
    deviations = size * np.sqrt(np.maximum(variance, 0.0))
    return Plain(size * values, np.where(determined, deviations, np.nan), sigma)


def _residual_rms(parts: list[tuple[Array, Array]], values: Array) -> Array:
    """rms residual of each joint, shape (n,); one for a joint without rows."""
    found = [np.sqrt(np.mean((aim - own @ values) ** 2)) if aim.size else 1.0 for own, aim in parts]
    return np.maximum(found, 1e-12 * max(found))
