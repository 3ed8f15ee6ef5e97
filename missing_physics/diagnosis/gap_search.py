"""Which causes explain the gap between two encoders.

The same rules as for torques: a cause enters only with evidence that beats the number of causes tried, with
coefficients that differ from zero when errors are allowed to be correlated in time, and when it lowers the
error in blocks it was not fitted to. Offsets between the encoders are free in every recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from missing_physics.diagnosis.gap import Gap
from missing_physics.diagnosis.gap_causes import Cause, exact_delay
from missing_physics.diagnosis.statistics import BlockedRegression, effective_samples, paired_block_p_value

__all__ = [
    "ODDS",
    "GapData",
    "GapFit",
    "GapSearch",
    "fit_gap",
    "plausible_shapes",
    "search_gap",
    "with_exact_delay",
]

Array = NDArray[np.float64]

#: Odds against one false entry that evidence must beat, on top of the number of causes tried.
ODDS = 100.0
#: Largest p-values of the cluster-robust test (before division by the number of causes) and of unseen blocks.
SIGNIFICANCE = 0.01
HELD_OUT = 0.05
#: Blocks over all recordings, and the shortest one [s].
BLOCKS = 24
SHORTEST_BLOCK = 0.25
#: Without validation recordings one stretch in four of each recording is held out.
STRETCHES = 16
EVERY = 4
#: Causes named at most for one joint.
MOST = 5
#: A shape whose log-evidence is within this of the best one's is not excluded.
SHAPE_EVIDENCE = 3.0


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
        self.time = np.concatenate([gap.segment.time for gap in gaps])
        self.position = np.concatenate([gap.segment.position[:, gap.index] for gap in gaps])
        self.velocity = np.concatenate([gap.segment.velocity[:, gap.index] for gap in gaps])
        self.offsets = np.equal.outer(self.recording, np.arange(len(gaps))).astype(float)
        self.blocks = self._blocks()
        seen = self.recording < trained
        self.fitted = seen if trained < len(gaps) else ~self._stretches()
        self.scored = ~self.fitted
        self._cache: dict[int, tuple[Cause, Array]] = {}

    def _blocks(self) -> NDArray[np.int_]:
        total = sum(float(gap.segment.time[-1] - gap.segment.time[0]) for gap in self.gaps)
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
    def noise_floor(self) -> float:
        """rms that the encoders' noise leaves."""
        return float(np.sqrt(np.mean([gap.noise_floor**2 for gap in self.gaps])))

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
        return all(
            coefficient * meaning.factor > 0
            for cause in self.causes
            for k, (meaning, coefficient) in enumerate(
                zip(cause.meanings, self.coefficients[self.slice_of(cause)])
            )
            if (cause.positive and k == 0) or meaning.power
        )

    def rms(self, rows: NDArray[np.bool_]) -> float:
        """rms of the residual over `rows`."""
        return float(np.sqrt(np.mean(self.residual[rows] ** 2))) if rows.any() else 0.0


@dataclass
class GapSearch:
    """Where the search ended, and every step: cause, what it was added to, fit, evidence, why not."""

    start: GapFit
    best: GapFit
    steps: list[tuple[Cause, GapFit, GapFit, float, str]] = field(default_factory=list)
    dropped: list[tuple[Cause, str]] = field(default_factory=list)
    tried: int = 1


def fit_gap(data: GapData, causes: Sequence[Cause]) -> GapFit:
    """Least squares of the fitted rows on offsets and causes."""
    matrix = np.column_stack([data.offsets, *(data.columns(cause) for cause in causes)])
    rows = data.fitted
    used = np.r_[data.offsets[rows].any(0), np.ones(matrix.shape[1] - data.offsets.shape[1], dtype=bool)]
    matrix = matrix[:, used]
    regression = BlockedRegression.of(matrix[rows], data.target[rows], data.blocks[rows])
    return GapFit(data, tuple(causes), regression, regression.solution(), matrix)


def search_gap(data: GapData, causes: Sequence[Cause], *, seed: int = 0) -> GapSearch:
    """Grow until nothing more is supported; a shape that fails on unseen data is shut out."""
    start = fit_gap(data, ())
    search = GapSearch(start, start, tried=len({cause.key for cause in causes}))
    open_causes = list(causes)
    while True:
        search.best = start
        while True:
            while len(search.best.causes) < MOST and _grow(data, search, open_causes, seed):
                _prune(data, search)
                search.best = _best_shapes(data, search.best, open_causes)
            if not _exchange(data, search, open_causes, seed):
                break
            search.best = _best_shapes(data, search.best, open_causes)
        failed = _failed(data, search.best, seed)
        if failed is None:
            kept = {cause.key for cause in search.best.causes}
            search.dropped = [item for item in search.dropped if item[0].key not in kept]
            return search
        search.dropped.append(failed)
        shut = failed[0].key, failed[0].shape
        open_causes = [cause for cause in open_causes if (cause.key, cause.shape) != shut]


def _grow(data: GapData, search: GapSearch, causes: Sequence[Cause], seed: int) -> bool:
    current = search.best
    taken = {cause.key for cause in current.causes}
    best: dict[tuple[str, str], tuple[float, GapFit, Cause]] = {}
    for cause in causes:
        if cause.key in taken:
            continue
        trial = fit_gap(data, [*current.causes, cause])
        evidence = trial.evidence_over(current)
        if trial.admissible and (cause.key not in best or evidence > best[cause.key][0]):
            best[cause.key] = (evidence, trial, cause)
    for evidence, trial, cause in sorted(best.values(), key=lambda item: -item[0])[:MOST]:
        why = _refusal(trial, current, cause, evidence=evidence, tried=search.tried, seed=seed)
        search.steps.append((cause, current, trial, evidence, why))
        if not why:
            search.best = with_exact_delay(data, trial)
            return True
    return False


def _exchange(data: GapData, search: GapSearch, causes: Sequence[Cause], seed: int) -> bool:
    """Put two causes in the place of one, or of none, where neither comes in alone.

    A sum of a delay and a wind-up looks more like a hysteresis than like either.
    """
    current = search.best
    best: tuple[float, GapFit] | None = None
    for old in current.causes or (None,):
        rest = [c for c in current.causes if old is None or c.key != old.key]
        taken = {c.key for c in rest}
        for one, two in combinations([c for c in causes if c.key not in taken], 2):
            if one.key != two.key:
                trial = fit_gap(data, [*rest, one, two])
                evidence = trial.evidence_over(current)
                if trial.admissible and (best is None or evidence > best[0]):
                    best = evidence, trial
    # As many pairs were tried as there are causes, squared.
    if best is None or best[0] < np.log(ODDS * search.tried**2):
        return False
    evidence, trial = best
    whys = [_refusal_within(data, trial, c, tried=search.tried, seed=seed) for c in trial.causes[-2:]]
    why = next((w for w in whys if w), "")
    for cause in trial.causes[-2:]:
        search.steps.append((cause, current, trial, evidence, why))
    if not why:
        search.best = with_exact_delay(data, trial)
    return not why


def _best_shapes(data: GapData, fit: GapFit, causes: Sequence[Cause]) -> GapFit:
    """`fit` with the shape of each cause that suits the others best; a richer one needs strong evidence."""
    for own in fit.causes:
        for shape in (c for c in causes if c.key == own.key):
            trial = fit_gap(data, [shape if c.key == own.key else c for c in fit.causes])
            needed = np.log(ODDS) if trial.size > fit.size else 0.0
            if trial.admissible and trial.evidence_over(fit) > needed and own.effect != "sensor_delay":
                fit = trial
    return with_exact_delay(data, fit)


def _refusal_within(data: GapData, trial: GapFit, cause: Cause, *, tried: int, seed: int) -> str:
    """Why a cause of `trial` does not stand beside the others."""
    without = fit_gap(data, [c for c in trial.causes if c.key != cause.key])
    evidence = trial.evidence_over(without)
    return _refusal(trial, without, cause, evidence=evidence, tried=tried, seed=seed)


def _refusal(trial: GapFit, current: GapFit, cause: Cause, *, evidence: float, tried: int, seed: int) -> str:
    """Why the cause may not enter; empty when it may."""
    needed = float(np.log(ODDS * tried))
    if evidence < needed:
        return f"evidence {evidence:.1f} is below the {needed:.1f} needed"
    place = trial.slice_of(cause)
    p_value = trial.regression.wald_p_value(np.arange(place.start, place.stop))
    if p_value > SIGNIFICANCE / tried:
        return f"not significant when errors are allowed to be correlated (p = {p_value:.2g})"
    gain = paired_block_p_value(
        current.regression.held_out_energy(), trial.regression.held_out_energy(), seed=seed
    )
    if gain > HELD_OUT:
        return f"does not lower the error in blocks it was not fitted to (p = {gain:.2g})"
    return ""


def _prune(data: GapData, search: GapSearch) -> None:
    """Leave out what later entries have made superfluous."""
    while len(search.best.causes) > 1:
        current = search.best
        for cause in current.causes:
            without = fit_gap(data, [c for c in current.causes if c.key != cause.key])
            if without.admissible and current.evidence_over(without) < np.log(ODDS):
                search.best = without
                break
        else:
            return


def _failed(data: GapData, fit: GapFit, seed: int) -> tuple[Cause, str] | None:
    """The cause that helps least in data it was not fitted to, when that is no more than chance."""
    worst: tuple[float, Cause] | None = None
    for cause in fit.causes:
        without = fit_gap(data, [c for c in fit.causes if c.key != cause.key])
        p_value = paired_block_p_value(without.block_energies(), fit.block_energies(), seed=seed)
        if p_value > HELD_OUT and (worst is None or p_value > worst[0]):
            worst = (p_value, cause)
    if worst is None:
        return None
    return worst[1], f"it fits the training data but does not lower the held-out error (p = {worst[0]:.2g})"


def plausible_shapes(data: GapData, fit: GapFit, causes: Sequence[Cause]) -> tuple[GapFit, ...]:
    """Fits with another shape of one of the causes that the data do not exclude; `fit` is the first."""
    found = [fit]
    for own in fit.causes:
        for shape in (c for c in causes if c.key == own.key and c.shape != own.shape):
            if len(shape.meanings) != len(own.meanings):
                continue
            trial = fit_gap(data, [shape if c.key == own.key else c for c in fit.causes])
            if trial.admissible and trial.evidence_over(fit) > -SHAPE_EVIDENCE:
                found.append(trial)
    return tuple(found)


def with_exact_delay(data: GapData, fit: GapFit) -> GapFit:
    """`fit` with its delay linearised about itself instead of about zero."""
    for _ in range(2):
        for cause in fit.causes:
            if cause.effect == "sensor_delay":
                around = float(fit.coefficients[fit.slice_of(cause)][0])
                exact = exact_delay(cause.location, around)
                fit = fit_gap(data, [exact if c.key == cause.key else c for c in fit.causes])
                break
    return fit
