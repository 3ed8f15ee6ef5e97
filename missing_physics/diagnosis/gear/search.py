"""Which causes explain the gap between two encoders.

The same rules as for torques: a cause enters only with evidence that beats the number of causes tried, with
coefficients that differ from zero when errors are allowed to be correlated in time, and when it lowers the
error in blocks it was not fitted to.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from missing_physics.diagnosis.gear.causes import Cause
from missing_physics.diagnosis.gear.cycles import FREE_ORDER, free_cycle
from missing_physics.diagnosis.gear.fit import GapData, GapFit, fit_gap
from missing_physics.diagnosis.gear.refinement import with_exact_shapes
from missing_physics.diagnosis.statistics.correlated_errors import paired_block_p_value

__all__ = ["ODDS", "GapSearch", "clashes", "plausible_shapes", "search_gap"]

#: Odds against one false entry that evidence must beat, on top of the number of causes tried.
ODDS = 100.0
#: Largest p-values of the cluster-robust test (before division by the number of causes) and of unseen blocks.
SIGNIFICANCE = 0.01
HELD_OUT = 0.05
#: What is smaller than so many times the rms of what encoders' steps make may be made of these.
ROUNDED = 3.0
#: Causes named at most for one joint.
MOST = 5
#: A shape whose log-evidence is within this of the best one's is not excluded.
SHAPE_EVIDENCE = 3.0
#: Effects that one gear does not show together: each would be what the other leaves of flanks that fly.
CLASHING = frozenset({"backlash", "gear_hysteresis"})


@dataclass
class GapSearch:
    """Where the search ended, and every step: cause, what it was added to, fit, evidence, why not."""

    start: GapFit
    best: GapFit
    steps: list[tuple[Cause, GapFit, GapFit, float, str]] = field(default_factory=list)
    dropped: list[tuple[Cause, str]] = field(default_factory=list)
    tried: int = 1


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
        # what had come in beside it comes again, if it still does
        search.steps = [
            (cause, onto, trial, evidence, why or failed[1])
            for cause, onto, trial, evidence, why in search.steps
            if why or cause.key == failed[0].key
        ]
        shut = failed[0].key, failed[0].shape
        open_causes = [cause for cause in open_causes if (cause.key, cause.shape) != shut]


def _grow(data: GapData, search: GapSearch, causes: Sequence[Cause], seed: int) -> bool:
    current = search.best
    taken = {cause.key for cause in current.causes}
    best: dict[tuple[str, str], tuple[float, GapFit, Cause]] = {}
    for cause in [*causes, *_free_cycles(data, search, current)]:
        if cause.key in taken or clashes(cause, taken):
            continue
        trial = fit_gap(data, [*current.causes, cause])
        evidence = trial.evidence_over(current)
        if trial.admissible and (cause.key not in best or evidence > best[cause.key][0]):
            best[cause.key] = (evidence, trial, cause)
    for evidence, trial, cause in sorted(best.values(), key=lambda item: -item[0])[:MOST]:
        why = _refusal(trial, current, cause, evidence=evidence, tried=search.tried, seed=seed)
        search.steps.append((cause, current, trial, evidence, why))
        if not why:
            search.best = with_exact_shapes(data, trial)
            return True
    return False


def _free_cycles(data: GapData, search: GapSearch, current: GapFit) -> Iterator[Cause]:
    """A cycle of any order at the joint's encoder, where it turns and none was refused."""
    channel = f"{data.gaps[0].joint}.position"
    own = "encoder_eccentricity", channel
    named = {cause.key for cause in current.causes}
    refused = {(cause.key, cause.shape) for cause, _ in search.dropped}
    if data.turns and own not in named and (own, FREE_ORDER) not in refused:
        cycle = free_cycle(data, current, channel, "rad")
        if cycle is not None:
            yield cycle


def _exchange(data: GapData, search: GapSearch, causes: Sequence[Cause], seed: int) -> bool:
    """Put two causes in the place of one, or of none, where neither comes in alone.

    A sum of a delay and a wind-up looks more like a hysteresis than like either.
    """
    current = search.best
    best: tuple[float, GapFit] | None = None
    for old in current.causes or (None,):
        rest = [c for c in current.causes if old is None or c.key != old.key]
        taken = {c.key for c in rest}
        free = [c for c in causes if c.key not in taken and not c.fine and not clashes(c, taken)]
        for one, two in combinations(free, 2):
            if one.key != two.key and not clashes(one, [two.key]):
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
        search.best = with_exact_shapes(data, trial)
    return not why


def _best_shapes(data: GapData, fit: GapFit, causes: Sequence[Cause]) -> GapFit:
    """`fit` with the shape of each cause that suits the others best; a richer one needs strong evidence."""
    for own in fit.causes:
        for shape in (c for c in causes if c.key == own.key):
            trial = fit_gap(data, [shape if c.key == own.key else c for c in fit.causes])
            needed = np.log(ODDS) if trial.size > fit.size else 0.0
            if trial.admissible and trial.evidence_over(fit) > needed and own.effect != "sensor_delay":
                fit = trial
    return with_exact_shapes(data, fit)


def _refusal_within(data: GapData, trial: GapFit, cause: Cause, *, tried: int, seed: int) -> str:
    """Why a cause of `trial` does not stand beside the others."""
    without = fit_gap(data, [c for c in trial.causes if c.key != cause.key])
    evidence = trial.evidence_over(without)
    return _refusal(trial, without, cause, evidence=evidence, tried=tried, seed=seed)


def _refusal(trial: GapFit, current: GapFit, cause: Cause, *, evidence: float, tried: int, seed: int) -> str:
    """Why the cause may not enter; empty when it may."""
    tried *= cause.trials
    needed = float(np.log(ODDS * tried))
    if evidence < needed:
        return f"evidence {evidence:.1f} is below the {needed:.1f} needed"
    if trial.size_of(cause) < ROUNDED * trial.data.steps:
        return "no larger than what the steps of the encoders make"
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


def clashes(cause: Cause, others: Collection[tuple[str, str]]) -> bool:
    """Whether a cause does not go together with one of the others."""
    return cause.effect in CLASHING and any(
        effect in CLASHING - {cause.effect} and location == cause.location for effect, location in others
    )
