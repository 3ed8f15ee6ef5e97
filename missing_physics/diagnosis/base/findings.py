"""From weighed hypotheses on the rates of a free base to findings, errors and series."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.answer.adequacy import adequacies
from missing_physics.answer.findings import QUANTILE, RIVAL, STATED
from missing_physics.diagnosis.base.data import BaseData
from missing_physics.hypotheses import Term
from missing_physics.inference import Fit, Posterior, Search
from missing_physics.results.result import Alternative, ChannelFit, ChannelSeries, Errors, Estimate, Finding
from reference_model.effects.base import SensorEffect
from reference_model.passive.prescribed import prescribed
from robot_model import Robot

__all__ = ["channel_fits", "findings_of", "left_by", "left_by_file", "series_of", "stated_terms"]

Array = NDArray[np.float64]
Key = tuple[str, str]


def findings_of(found: Search[BaseData], known: Posterior) -> tuple[Finding, ...]:
    """What the most probable hypothesis states, with its rivals in the others."""
    right, made = adequacies(found.data, known.answer), []
    for term in sorted(known.answer.hypothesis.terms, key=lambda term: term.key):
        chance, rivals = known.probability(term.key), _rivals(known, term.key)
        if chance > STATED or (chance >= RIVAL and rivals):
            finding = Finding(
                effect=term.effect.id,
                location=term.at,
                probability=right(term.at) * min(chance, 1.0),
                parameters=_parameters(known.answer, term),
                ambiguous_with=tuple(f"{effect}@{at}" for (effect, at), _ in rivals),
                alternatives=tuple(
                    Alternative(*rival, p, "it predicts held-out data less well") for rival, p in rivals
                ),
                validation_improvement=_gain(found, known.answer, term.key),
            )
            made.append(finding)
    return tuple(made)


def stated_terms(fit: Fit, findings: tuple[Finding, ...]) -> tuple[Term, ...]:
    """Terms of a fit that are findings."""
    stated = {(finding.effect, finding.location) for finding in findings}
    return tuple(term for term in fit.hypothesis.terms if term.key in stated)


def _rivals(known: Posterior, key: Key) -> list[tuple[Key, float]]:
    """Effects that hypotheses without one hold instead, with their probabilities."""
    own, found = {term.key for term in known.answer.hypothesis.terms}, dict[Key, float]()
    for fit, weight in zip(known.fits, known.weights):
        theirs = {term.key for term in fit.hypothesis.terms}
        for rival in theirs - own if key not in theirs else ():
            found[rival] = found.get(rival, 0.0) + float(weight)
    return sorted(((rival, p) for rival, p in found.items() if p >= RIVAL), key=lambda one: -one[1])


def _parameters(fit: Fit, term: Term) -> dict[str, Estimate]:
    """Values with 95 % intervals; a number that the effect lacks is not stated."""
    found = {}
    for p in term.free:
        value = term.parameters[p.name]
        half = QUANTILE * fit.deviation(f"{term.effect.id}@{term.at}.{p.name}")
        ends = max(value - half, p.lower), min(value + half, p.upper)
        found[p.name] = Estimate(value, ends, p.unit)
    return found


def _gain(found: Search[BaseData], fit: Fit, key: Key) -> float:
    """Part of the held-out error that an effect removes, compared with the same hypothesis without it."""
    less = {term.key for term in fit.hypothesis.terms} - {key}
    others = [one for one in found.made.values() if {t.key for t in one.hypothesis.terms} == less]
    if not others:
        return 0.0
    unseen = ~found.data.seen
    before, after = (
        float(np.sum(one.errors[unseen] / fit.sigma**2)) for one in (max(others, key=found.score), fit)
    )
    return 1.0 - float(np.sqrt(after / before)) if before > 0.0 else 0.0


def left_by(data: BaseData, fit: Fit, terms: tuple[Term, ...], run: int) -> Array:
    """Residual with the robot file's bodies and some terms, shape (K, m) [rad/s].

    What a recording says itself, its momentum at the start among it, is as in a fit.
    """
    numbers = data.filed.copy()
    places = [data.layout.names.index(name) for name in data.further]
    numbers[places] = fit.numbers[places]
    return data.target(run) - data.designs[run] @ numbers - data.terms.contributed(terms, run)


def left_by_file(data: BaseData, fit: Fit, terms: tuple[Term, ...], file: Robot, run: int) -> Array:
    """Residual of a robot file and the errors of gyros among some terms, shape (K, m) [rad/s]."""
    own = data.runs[run]
    motion = own.dynamics.motion
    made = prescribed(file, motion.time, motion.position, motion.velocity, motion.acceleration)
    rates = np.column_stack([made[channel] for channel in own.channels])
    change = own.reduce(rates - own.predicted) * data.counted(run)
    of_gyros = tuple(term for term in terms if isinstance(term.effect, SensorEffect))
    return left_by(data, fit, of_gyros, run) - data.quiet[run].removed(change)


def channel_fits(
    data: BaseData, before: Sequence[Array], after: Sequence[Array]
) -> Iterator[tuple[str, ChannelFit]]:
    """Errors of the nominal and of the written robot file, gyro by gyro, from the residuals of each run."""
    for k, channel in enumerate(data.joints):
        first, last = (_errors(data, left, k) for left in (before, after))
        yield channel, ChannelFit("rad/s", first, last, float(data.noise[k]))


def _errors(data: BaseData, every: Sequence[Array], k: int) -> Errors:
    parts: tuple[list[Array], list[Array]] = [], []
    for i, left in enumerate(every):
        seen, counted = data.rows_seen(i), data.counted(i)[:, k]
        for part, which in zip(parts, (seen, ~seen)):
            part.append(left[which & counted, k])
    return Errors(*(float(np.sqrt(np.mean(np.concatenate(part) ** 2))) for part in parts))


def series_of(data: BaseData, before: Sequence[Array], after: Sequence[Array]) -> Iterator[ChannelSeries]:
    """Rates about their means, and what the nominal and the written robot file predict of them."""
    for k, channel in enumerate(data.joints):
        for i, own in enumerate(data.runs):
            measured = own.reduce(own.measured[:, k] - own.measured[:, k].mean())
            yield ChannelSeries(
                recording=own.dynamics.motion.source,
                role="train" if i < data.fitted else "validation",
                channel=channel,
                unit="rad/s",
                location="base",
                time=data.time(i),
                measured=measured,
                nominal=measured - before[i][:, k],
                augmented=measured - after[i][:, k],
                held_out=~data.rows_seen(i),
                noise_floor=float(data.noise[k]),
                counted=data.counted(i)[:, k],
            )
