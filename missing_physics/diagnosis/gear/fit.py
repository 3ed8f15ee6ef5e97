"""Gaps between two encoders as data, and causes fitted to them by least squares.

Offsets between the encoders are free in every recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from missing_physics.diagnosis.gear.causes import Cause, Meaning
from missing_physics.diagnosis.gear.gap import Gap
from missing_physics.diagnosis.statistics.correlated_errors import BlockedRegression, effective_samples

__all__ = ["GapData", "GapFit", "fit_gap"]

Array = NDArray[np.float64]

#: Blocks over all recordings, and the shortest one [s].
BLOCKS = 24
SHORTEST_BLOCK = 0.25
#: Without validation recordings one stretch in four of each recording is held out.
STRETCHES = 16
EVERY = 4


class GapData:
    """Gaps of one joint over several recordings, filtered and stacked.

    Attributes:
        gaps: fitted recordings first.
        target: filtered difference, shape (R,).
        time, recording, blocks: of each row.
        fitted, scored: which rows are fitted, and which are only scored.
        offsets: one column per recording, shape (R, G).
    """

    def __init__(self, gaps: Sequence[Gap], trained: int) -> None:
        self.gaps = tuple(gaps)
        parts = [gap.reduce(gap.difference) for gap in gaps]
        self.target = np.concatenate(parts)
        self.recording = np.concatenate([np.full(part.size, i) for i, part in enumerate(parts)])
        self.time = np.concatenate([gap.along.time for gap in gaps])
        self.position = np.concatenate([gap.along.position[:, gap.index] for gap in gaps])
        self.velocity = np.concatenate([gap.along.velocity[:, gap.index] for gap in gaps])
        self.offsets = np.equal.outer(self.recording, np.arange(len(gaps))).astype(float)
        self.blocks = self._blocks()
        seen = self.recording < trained
        self.fitted = seen if trained < len(gaps) else ~self._stretches()
        self.scored = ~self.fitted
        self._cache: dict[int, tuple[Cause, Array]] = {}

    def _blocks(self) -> NDArray[np.int_]:
        total = sum(float(gap.along.time[-1] - gap.along.time[0]) for gap in self.gaps)
        length = max(total / BLOCKS, SHORTEST_BLOCK)
        numbers = np.zeros(self.time.size, dtype=int)
        first = 0
        for number in range(len(self.gaps)):
            own = self.recording == number
            local = ((self.time[own] - self.time[own][0]) / length).astype(int)
            numbers[own] = first + local
            first += int(local.max()) + 1
        return numbers

    def _stretches(self) -> NDArray[np.bool_]:
        held = np.zeros(self.time.size, dtype=bool)
        for number in range(len(self.gaps)):
            own = np.flatnonzero(self.recording == number)
            stretch = (np.arange(own.size) * STRETCHES) // own.size
            held[own[stretch % EVERY == EVERY // 2]] = True
        return held

    @property
    def turns(self) -> bool:
        """Whether the joint is one that turns."""
        gap = self.gaps[0]
        return gap.along.joints[gap.index].kind != "prismatic"

    @property
    def noise_floor(self) -> float:
        """rms that the encoders' noise leaves."""
        return float(np.sqrt(np.mean([gap.noise_floor**2 for gap in self.gaps])))

    @property
    def steps(self) -> float:
        """rms of what the encoders' steps make of slow motions."""
        return float(np.sqrt(np.mean([gap.steps**2 for gap in self.gaps])))

    def columns(self, cause: Cause) -> Array:
        """Filtered columns of a cause, shape (R, k)."""
        if id(cause) not in self._cache:
            blocks = [gap.reduce(cause.columns(gap)) for gap in self.gaps]
            self._cache[id(cause)] = cause, np.concatenate(blocks)  # the cause lives, and its id with it
        return self._cache[id(cause)][1]


@dataclass(frozen=True)
class GapFit:
    """Causes fitted together with the offsets.

    Attributes:
        data: what was fitted.
        causes: in order of entry.
        regression: on the fitted rows; offsets first.
        coefficients: of all columns.
    """

    data: GapData
    causes: tuple[Cause, ...]
    regression: BlockedRegression
    coefficients: Array
    matrix: Array = field(repr=False)

    @cached_property
    def residual(self) -> Array:
        """Difference less the explanation, each recording about its own mean, shape (R,).

        The mean of a scored recording comes from itself: encoders' zeros are no matter of this physics.
        """
        left = self.data.target - self.matrix @ self.coefficients
        result = left.copy()
        for column in self.data.offsets.T:
            own = column > 0
            basis = own & self.data.fitted if (own & self.data.fitted).any() else own
            result[own] = left[own] - left[basis].mean()
        return result

    @property
    def energy(self) -> float:
        """Residual energy on the fitted rows, not counted below that of noise.

        What goes below it fits the noise itself, which the gap shares with every column made of the motor's
        position.
        """
        rows = self.data.fitted
        floor = self.data.noise_floor**2 * int(rows.sum())
        return float(max((self.residual[rows] ** 2).sum(), floor, 1e-300))

    @cached_property
    def effective(self) -> float:
        """Effective number of fitted samples."""
        return effective_samples(self.residual[self.data.fitted])

    @property
    def size(self) -> int:
        """Number of the causes' coefficients."""
        return sum(len(cause.meanings) for cause in self.causes)

    def slice_of(self, cause: Cause) -> slice:
        """Places of a cause's coefficients."""
        start = self.coefficients.size - self.size
        for other in self.causes:
            if other.key == cause.key:
                return slice(start, start + len(other.meanings))
            start += len(other.meanings)
        raise KeyError(cause.key)

    def size_of(self, cause: Cause) -> float:
        """rms of what a cause makes in the fitted rows."""
        made = self.data.columns(cause) @ self.coefficients[self.slice_of(cause)]
        return float(np.std(made[self.data.fitted]))

    def values(self, cause: Cause) -> tuple[Array, Array]:
        """Coefficients of a cause and the half widths of their 95 % intervals.

        The wider of two: by blocks, which allows for any correlation but is unsure of itself with a dozen
        blocks, and by the effective number of samples.
        """
        place = self.slice_of(cause)
        own = np.eye(self.coefficients.size)[place]
        return self.coefficients[place], np.array([self.half_width(row) for row in own])

    def half_width(self, weights: Array) -> float:
        """Half the 95 % interval of a sum of all coefficients with these weights; see `values`."""
        by_blocks, by_samples = self._covariances
        variance = max(float(weights @ by_blocks @ weights), float(weights @ by_samples @ weights), 0.0)
        quantile = stats.t.ppf(0.975, max(self.regression.gram.shape[0] - 1, 2))
        return float(quantile * np.sqrt(variance))

    @cached_property
    def _covariances(self) -> tuple[Array, Array]:
        regression = self.regression
        left = self.residual[self.data.fitted]
        inverse = np.linalg.pinv(regression.gram.sum(0), hermitian=True)
        white = float(left @ left) / max(self.effective - self.coefficients.size, 1.0)
        by_samples = white * inverse / np.outer(regression.scale, regression.scale)
        return regression.covariance(), by_samples

    @property
    def compliance(self) -> tuple[int, float] | None:
        """Place and value of the coefficient of a wind-up, where there is one."""
        for cause in self.causes:
            if cause.meanings[0].inverse:
                place = self.slice_of(cause).start
                return place, float(self.coefficients[place])
        return None

    def evidence_over(self, simpler: GapFit) -> float:
        """Log of the odds by the Bayesian information criterion with effective samples."""
        effective = min(self.effective, simpler.effective)
        gain = 0.5 * effective * np.log(simpler.energy / self.energy)
        return float(gain - 0.5 * (self.size - simpler.size) * np.log(max(effective, 2.0)))

    def block_energies(self) -> Array:
        """Residual energy of each scored block."""
        rows = self.data.scored
        _, index = np.unique(self.data.blocks[rows], return_inverse=True)
        return np.asarray(np.bincount(index, self.residual[rows] ** 2), dtype=float)

    @property
    def admissible(self) -> bool:
        """Whether every cause has the sign that makes it this effect (a wind-up follows the torque)."""
        spring = self.compliance
        return all(
            _credible(meaning, float(coefficient), spring[1] if spring else 0.0)
            for cause in self.causes
            for k, (meaning, coefficient) in enumerate(
                zip(cause.meanings, self.coefficients[self.slice_of(cause)])
            )
            if (cause.positive and k == 0) or (meaning.power and not meaning.relative)
        )

    def rms(self, rows: NDArray[np.bool_]) -> float:
        """rms of the residual over `rows`."""
        return float(np.sqrt(np.mean(self.residual[rows] ** 2))) if rows.any() else 0.0


def _credible(meaning: Meaning, coefficient: float, compliance: float) -> bool:
    """Whether a coefficient has its sign, and is not larger than any gear's."""
    bounded = not np.isfinite(meaning.most) or abs(coefficient) <= meaning.most * compliance
    return coefficient * meaning.factor > 0 and bounded


def fit_gap(data: GapData, causes: Sequence[Cause]) -> GapFit:
    """Least squares of the fitted rows on offsets and causes."""
    matrix = np.column_stack([data.offsets, *(data.columns(cause) for cause in causes)])
    rows = data.fitted
    used = np.r_[data.offsets[rows].any(0), np.ones(matrix.shape[1] - data.offsets.shape[1], dtype=bool)]
    matrix = matrix[:, used]
    regression = BlockedRegression.of(matrix[rows], data.target[rows], data.blocks[rows])
    return GapFit(data, tuple(causes), regression, regression.solution(), matrix)
