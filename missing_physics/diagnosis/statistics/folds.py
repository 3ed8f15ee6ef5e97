"""Least squares in which long stretches of the data are left out in turn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

__all__ = ["LATER", "Folds", "forecast_error", "jackknife", "solved"]

Array = NDArray[np.float64]

#: Long stretches of each part of the data that are left out in turn.
FOLDS = 8
#: Blocks of the held-out part are numbered from here.
LATER = 1_000_000
#: Keeps normal equations of collinear columns solvable, relative to their diagonal.
COLLINEAR = 1e-10


def solved(gram: Array, moment: Array) -> Array:
    """The solution of normal equations, of whatever units and however collinear."""
    if not moment.size:
        return moment
    size = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    scaled = gram / np.outer(size, size) + COLLINEAR * np.eye(size.size)
    return np.asarray(np.linalg.solve(scaled, moment / size) / size)


class Folds:
    """Least squares in which long stretches of both parts of the data are left out in turn.

    Args:
        columns, target, blocks: rows of both parts, the fitted one first; blocks of the other are numbered
            from `LATER` on.
        gram, moment: X'X and X'y of rows that are never left out.
    """

    def __init__(
        self, columns: Array, target: Array, blocks: NDArray[np.int_], gram: Array, moment: Array
    ) -> None:
        starts = np.flatnonzero(np.r_[True, np.diff(blocks) != 0])
        spans = list(zip(starts, np.r_[starts[1:], blocks.size]))
        self.early = np.array([blocks[a] < LATER for a, _ in spans])
        self._grams = np.stack([columns[a:b].T @ columns[a:b] for a, b in spans])
        self._moments = np.stack([columns[a:b].T @ target[a:b] for a, b in spans])
        self._energy = np.array([float(target[a:b] @ target[a:b]) for a, b in spans])
        self._always = gram, moment
        counts = int(self.early.sum()), int((~self.early).sum())
        early, late = (np.arange(n) * FOLDS // max(n, 1) for n in counts)
        # What depends on time must be known from the other part where a stretch of one is left out.
        self._fold = np.concatenate([early, (late + FOLDS // 2) % FOLDS])

    def _solution(self, ridge: Array, kept: NDArray[np.bool_]) -> Array:
        gram, moment = self._always
        whole = self._grams[kept].sum(0) + gram + np.diag(ridge)
        return solved(whole, self._moments[kept].sum(0) + moment)

    def solution(self, ridge: Array) -> Array:
        """With nothing left out."""
        return self._solution(ridge, np.ones(self._fold.size, dtype=bool))

    def energies(self, ridge: Array) -> tuple[Array, Array]:
        """Of each block, as foretold by all other stretches; and by what, shape (folds, K)."""
        left = np.empty(self._fold.size)
        without = []
        for number in np.unique(self._fold):
            out = self._fold == number
            beta = self._solution(ridge, ~out)
            quadratic = np.einsum("i,gij,j->g", beta, self._grams[out], beta)
            left[out] = self._energy[out] - 2 * self._moments[out] @ beta + quadratic
            without.append(beta)
        return np.maximum(left, 0.0), np.array(without)


def jackknife(without: Array) -> Array:
    """Half the width of the 95 % interval of numbers fitted without one group of the data at a time.

    Args:
        without: the numbers without each of G groups, shape (G, K).

    Returns:
        Shape (K,); infinite where there is one group only.
    """
    groups = len(without)
    if groups < 2:
        return np.full(without.shape[1], np.inf)
    error = np.sqrt((groups - 1) / groups * np.sum((without - without.mean(axis=0)) ** 2, axis=0))
    return np.asarray(student.ppf(0.975, groups - 1) * error)


def forecast_error(
    rows: Array, blocks: NDArray[np.int_], prior: Array, asked: Array, *, alternate: bool = False
) -> float:
    """Mean square of a forecast's error that the uncertainty of fitted numbers makes.

    Args:
        rows: columns, and the target beside them, of what is fitted, shape (R, K + 1).
        blocks: block of each row, rising, shape (R,).
        prior: inverse variance of each number about nothing, shape (K,).
        asked: columns of what is forecast, shape (M, K).
        alternate: whether the stretches left out are every so many of the blocks, which tell of what
            happens in few long stretches only, in the place of long ones.

    Returns:
        What it exceeds with 5 % chance, by the jackknife over these stretches.
    """
    order = np.unique(blocks, return_inverse=True)[1]
    fold = order % FOLDS if alternate else order * FOLDS // (int(order.max()) + 1)
    parts = [rows[fold == k] for k in np.unique(fold)]
    grams = np.stack([part.T @ part for part in parts])
    if len(grams) < 2:
        return float("inf")
    kept = grams.sum(0) - grams
    without = np.stack([solved(g[:-1, :-1] + np.diag(prior), g[:-1, -1]) for g in kept])
    spread = without - without.mean(axis=0)
    mean = np.einsum("gi,ij,gj->", spread, asked.T @ asked, spread) / max(len(asked), 1)
    groups = len(grams)
    return float(student.ppf(0.975, groups - 1) ** 2 * (groups - 1) / groups * mean)
