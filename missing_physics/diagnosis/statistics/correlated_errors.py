"""Regression with errors that are correlated in time: everything is counted in blocks.

Model errors of real machines are not white, so that formulas for independent samples promise far too much.
All inference here rests on blocks of consecutive samples, longer than the errors' memory: covariances that
are robust to what happens within a block (the jackknife that leaves blocks out, CR3 of Bell and McCaffrey,
Survey Methodology 28 (2002) 169-181, with their degrees of freedom; small-sample F as in Cameron and Miller,
J. Human Resources 50 (2015) 317-372), cross-validation that leaves whole blocks out, and block bootstrap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.linalg import cho_factor, cho_solve

__all__ = ["NOTHING", "BlockedRegression", "effective_samples", "paired_block_p_value"]

Array = NDArray[np.float64]

#: A column of this length or less is none: the square of its coefficient's deviation would overflow.
NOTHING = 1e-140
#: Relative ridge that keeps the Gram matrix invertible when columns are collinear.
RIDGE = 1e-10
#: Folds of the cross-validation inside the training data.
FOLDS = 8
#: Lags up to this part of a series are looked at for memory.
LAG_PART = 10


@dataclass(frozen=True)
class BlockedRegression:
    """Least squares of `target` on `columns`, with sums kept block by block.

    Attributes:
        gram: shape (G, k, k), X'X of each block; columns are scaled to unit length beforehand.
        moment: shape (G, k), X'y.
        energy: shape (G,), y'y.
        scale: shape (k,), length of each column.
        rows: number of samples.
        prior: shape (k,), added to the diagonal of X'X: what is known of the scaled coefficients beforehand.
        alternate: whether cross-validation leaves out every second block instead of long folds.
    """

    gram: Array
    moment: Array
    energy: Array
    scale: Array
    rows: int
    prior: Array
    alternate: bool = False

    @classmethod
    def of(
        cls,
        columns: Array,
        target: Array,
        blocks: NDArray[np.int_],
        *,
        prior: Array | None = None,
        alternate: bool = False,
    ) -> BlockedRegression:
        """From columns (R, k), target (R,) and the block each row belongs to (R,), rising.

        `prior` holds the inverse variance of each coefficient about zero, shape (k,); none when left out.
        """
        scale = np.linalg.norm(columns, axis=0)
        scale[scale < NOTHING] = 1.0
        x = columns / scale
        starts = np.flatnonzero(np.r_[True, np.diff(blocks) != 0])
        parts = list(zip(starts, np.r_[starts[1:], blocks.size]))
        gram = np.stack([x[a:b].T @ x[a:b] for a, b in parts])
        moment = np.stack([x[a:b].T @ target[a:b] for a, b in parts])
        energy = np.array([float(target[a:b] @ target[a:b]) for a, b in parts])
        known = np.zeros(scale.size) if prior is None else prior / scale**2
        return cls(gram, moment, energy, scale, int(target.size), known, alternate)

    def _solve(self, gram: Array, moment: Array) -> Array:
        k = gram.shape[0]
        if k == 0:
            return np.zeros(0)
        return np.asarray(cho_solve(cho_factor(gram + np.diag(self.prior + RIDGE)), moment))

    def scaled_solution(self) -> Array:
        """Least-squares coefficients of the scaled columns, shape (k,)."""
        return self._solve(self.gram.sum(0), self.moment.sum(0))

    def solution(self) -> Array:
        """Least-squares coefficients, shape (k,)."""
        return self.scaled_solution() / self.scale

    def block_energy(self, beta: Array) -> Array:
        """Sum of squares left in each block with scaled coefficients `beta`, shape (G,)."""
        quadratic = np.einsum("i,gij,j->g", beta, self.gram, beta)
        return np.asarray(self.energy - 2 * self.moment @ beta + quadratic)

    def held_out_energy(self) -> Array:
        """Sum of squares of each block predicted from the other folds, shape (G,)."""
        groups = self.gram.shape[0]
        fold = np.arange(groups) % 2 if self.alternate else (np.arange(groups) * FOLDS) // groups
        gram, moment = self.gram.sum(0), self.moment.sum(0)
        left = np.empty(groups)
        for number in np.unique(fold):
            out = fold == number
            beta = self._solve(gram - self.gram[out].sum(0), moment - self.moment[out].sum(0))
            left[out] = self.block_energy(beta)[out]
        return left

    def covariance(self) -> Array:
        """Covariance of the coefficients by the jackknife that leaves one block out at a time, shape (k, k).

        The sandwich of Liang and Zeger takes residuals for errors. Where few blocks determine a coefficient,
        or there are many coefficients, the fit has bent itself to these errors and they look too small.
        """
        groups = self.gram.shape[0]
        beta = self.scaled_solution()
        if beta.size == 0:
            return np.zeros((0, 0))
        scores = self.moment - np.einsum("gij,j->gi", self.gram, beta)
        others = self.gram.sum(0) + np.diag(self.prior + RIDGE) - self.gram
        changes = np.linalg.solve(others, scores[:, :, None])[:, :, 0]
        scaled = changes.T @ changes * (groups - 1) / groups
        return np.asarray(scaled / np.outer(self.scale, self.scale))

    def wald_p_value(self, tested: NDArray[np.int_]) -> float:
        """Probability of a departure from zero as large as this if the `tested` coefficients are zero.

        One where none is tested, or too few blocks determine it.
        """
        groups, m = self.gram.shape[0], tested.size
        if m == 0 or groups - m < 2:
            return 1.0
        beta = self.solution()[tested]
        covariance = self.covariance()[np.ix_(tested, tested)]
        statistic = float(beta @ np.linalg.pinv(covariance, hermitian=True) @ beta)
        freedom = groups - m
        return float(stats.f.sf(statistic * freedom / (m * max(groups - 1, 1)), m, freedom))


def effective_samples(series: Array) -> float:
    """Number of independent samples with the same information about a mean of squares.

    Sums the squared autocorrelation over the first part of all lags and takes away what chance alone puts
    there (Bayley and Hammersley, J. R. Stat. Soc. Suppl. 8 (1946) 184-197).
    """
    centred = series - series.mean()
    size = centred.size
    largest = float(np.abs(centred).max(initial=0.0))
    if size < 20 or largest == 0.0:
        return float(size)
    centred /= largest  # whose square could vanish
    spectrum = np.abs(np.fft.rfft(centred, 2 * size)) ** 2
    correlation = np.fft.irfft(spectrum)[:size]
    correlation /= correlation[0]
    last = max(size // LAG_PART, 2)
    memory = float(np.sum(correlation[1:last] ** 2)) - (last - 1) / size
    return size / (1.0 + 2.0 * max(memory, 0.0))


def paired_block_p_value(before: Array, after: Array, *, seed: int = 0, draws: int = 2000) -> float:
    """One-sided bootstrap probability that the block errors did not fall, shape (G,) each."""
    gain = before - after
    if gain.size < 3:
        return 0.0 if gain.sum() > 0 else 1.0
    chance = np.random.default_rng(seed)
    sums = gain[chance.integers(0, gain.size, (draws, gain.size))].sum(1)
    return float((1 + np.count_nonzero(sums <= 0)) / (draws + 1))
