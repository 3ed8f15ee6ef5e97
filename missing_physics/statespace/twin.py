"""The kernel's three functions in NumPy, with the same arguments and numbers, where there is no compiler.

They loop over samples in Python and are some hundred times slower; arguments are those of `kernel.c`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["gains", "smooth", "whiten"]

Array = NDArray[np.float64]
Rows = NDArray[np.int32]


def _step(h: float, b: float, k: float, d: float) -> tuple[Array, Array]:
    """Transition of [q; v] by the implicit midpoint rule, shape (2, 2), and what a force does to it, (2,)."""
    c = h * (0.25 * h * k + 0.5 * d)
    rate = np.array([-h * k, 1.0 - c]) / (1.0 + c)
    pushed = h * b / (1.0 + c)
    place = np.array([1.0 + 0.5 * h * rate[0], 0.5 * h * (1.0 + rate[1])])
    return np.array([place, rate]), np.array([0.5 * h * pushed, pushed])


def _transition(h: float, b: float, k: float, d: float, tau: Array) -> tuple[Array, Array]:
    """Of the whole state, shape (2 + L, 2 + L), and what a force does to it, shape (2 + L,)."""
    states = 2 + tau.size
    inner, pushed = _step(h, b, k, d)
    whole, force = np.zeros((states, states)), np.zeros(states)
    whole[:2, :2], force[:2] = inner, pushed
    whole[:2, 2:] = pushed[:, None]
    whole[2:, 2:] = np.diag(np.exp(-h / tau))
    return whole, force


def gains(
    count: int,
    latent: int,
    width: int,
    rows: Rows,
    h: Array,
    b: Array,
    k: Array,
    d: Array,
    force: Array,
    tau: Array,
    levels: Array,
    noise: Array,
    start: Array,
    gain: Array,
    variance: Array,
    predicted: Array | None,
) -> None:
    """Fill `gain`, `variance` and, where asked for, `predicted`."""
    covariance = np.diag(start)
    for t in range(count):
        if predicted is not None:
            predicted[t] = covariance
        for j in range(width):
            if noise[t, j] < 0.0:
                gain[t, j], variance[t, j] = 0.0, 0.0
                continue
            own = covariance[rows[j], rows[j]] + noise[t, j]
            gain[t, j], variance[t, j] = covariance[:, rows[j]] / own, own
            covariance = covariance - own * np.outer(gain[t, j], gain[t, j])
        whole, pushed = _transition(h[t], b[t], k[t], d[t], tau)
        covariance = whole @ covariance @ whole.T + force[t] * np.outer(pushed, pushed)
        covariance[2:, 2:] += np.diag((1.0 - np.exp(-2.0 * h[t] / tau)) * levels)


def whiten(
    count: int,
    latent: int,
    width: int,
    rows: Rows,
    h: Array,
    b: Array,
    k: Array,
    d: Array,
    tau: Array,
    gain: Array,
    variance: Array,
    force: Array | None,
    measured: Array | None,
    columns: int,
    white: Array,
    predicted: Array | None,
) -> None:
    """Fill `white` and, where asked for, `predicted` of the one column."""
    state = np.zeros((2 + latent, columns))
    for t in range(count):
        if predicted is not None:
            predicted[t] = state[:, 0]
        for j in range(width):
            if variance[t, j] <= 0.0:
                white[t, j] = 0.0
                continue
            error = (0.0 if measured is None else measured[t, j]) - state[rows[j]]
            white[t, j] = error / np.sqrt(variance[t, j])
            state = state + np.outer(gain[t, j], error)
        whole, pushed = _transition(h[t], b[t], k[t], d[t], tau)
        state = whole @ state + (0.0 if force is None else np.outer(pushed, force[t]))


def smooth(
    count: int,
    latent: int,
    width: int,
    rows: Rows,
    h: Array,
    b: Array,
    k: Array,
    d: Array,
    tau: Array,
    gain: Array,
    variance: Array,
    white: Array,
    covariances: Array,
    predicted: Array,
    mean: Array,
    spread: Array,
) -> None:
    """Fill `mean` and `spread` of the states by the adjoint recursion of Bryson and Frazier."""
    states = 2 + latent
    adjoint, information = np.zeros(states), np.zeros((states, states))
    for t in range(count - 1, -1, -1):
        if t < count - 1:
            whole, _ = _transition(h[t], b[t], k[t], d[t], tau)
            adjoint, information = whole.T @ adjoint, whole.T @ information @ whole
        for j in range(width - 1, -1, -1):
            own = variance[t, j]
            if own <= 0.0:
                continue
            kept = np.eye(states)
            kept[:, rows[j]] -= gain[t, j]
            adjoint, information = kept.T @ adjoint, kept.T @ information @ kept
            adjoint[rows[j]] -= white[t, j, 0] / np.sqrt(own)
            information[rows[j], rows[j]] += 1.0 / own
        mean[t] = predicted[t] - covariances[t] @ adjoint
        left = np.diag(covariances[t] - covariances[t] @ information @ covariances[t])
        spread[t] = np.maximum(left, 0.0)
