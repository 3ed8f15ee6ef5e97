"""Findings from the posterior over hypotheses on further sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from missing_physics.answer.adequacy import adequacies
from missing_physics.answer.findings import QUANTILE, RIVAL, STATED
from missing_physics.hypotheses import Term
from missing_physics.inference import Fit, Posterior, Search
from missing_physics.results.result import Alternative, Estimate, Finding
from reference_model.effects.base import Parameter

__all__ = ["Key", "Reading", "findings_of"]

#: Effect and place.
Key = tuple[str, str]
Numbers = Mapping[str, tuple[Term, Parameter]]


def _keys_of(terms: Sequence[Term]) -> frozenset[Key]:
    return frozenset(term.key for term in terms)


def _parameters_of(key: Key, terms: Sequence[Term]) -> Numbers:
    return {p.name: (term, p) for term in terms if term.key == key for p in term.free}


@dataclass(frozen=True)
class Reading:
    """How terms translate into findings.

    Attributes:
        channels: indices of the channels in which an effect is visible.
        keys_of: effects and places that terms represent.
        numbers_of: the term and its parameter for each parameter of a reported effect.
        unit: unit of a parameter at a place.
    """

    channels: Callable[[Key], Sequence[int]]
    keys_of: Callable[[Sequence[Term]], frozenset[Key]] = _keys_of
    parameters_of: Callable[[Key, Sequence[Term]], Numbers] = _parameters_of
    unit: Callable[[Key, Parameter], str] = lambda _, p: p.unit

    def of(self, fit: Fit) -> frozenset[Key]:
        """Effects and places that a fit represents."""
        return self.keys_of(fit.hypothesis.terms)


def findings_of(found: Search[Any], known: Posterior, reading: Reading) -> tuple[Finding, ...]:
    """Findings of the most probable hypothesis, channel by channel, with rivals from other hypotheses."""
    return tuple(_findings(found, known, reading))


def _findings(found: Search[Any], known: Posterior, reading: Reading) -> Iterator[Finding]:
    adequate = adequacies(found.data, known.answer, found.standard)
    for key in sorted(reading.of(known.answer), key=lambda key: (list(reading.channels(key)), key)):
        held = [key in reading.of(fit) for fit in known.fits]
        chance, rivals = float(known.weights[held].sum()), _rivals(known, key, reading)
        if chance > STATED or (chance >= RIVAL and rivals):
            yield Finding(
                effect=key[0],
                location=key[1],
                probability=adequate(*key) * min(chance, 1.0),
                parameters=_parameters(known, key, reading),
                ambiguous_with=tuple(f"{effect}@{at}" for (effect, at), _ in rivals),
                alternatives=tuple(
                    Alternative(*rival, p, "it predicts held-out data less well") for rival, p in rivals
                ),
                validation_improvement=_gain(found, known.answer, key, reading),
            )


def _rivals(known: Posterior, key: Key, reading: Reading) -> list[tuple[Key, float]]:
    """Effects that replace an effect in hypotheses without it, with their probabilities."""
    own, found = reading.of(known.answer), dict[Key, float]()
    for other, weight in zip(known.fits, known.weights):
        theirs = reading.of(other)
        if key not in theirs:
            alone = len(own - theirs) == 1  # no other effect is missing: all added effects are rivals
            for rival in theirs - own:
                if alone or rival[1].split(".")[0] == key[1].split(".")[0]:
                    found[rival] = found.get(rival, 0.0) + float(weight)
    return sorted(((rival, p) for rival, p in found.items() if p >= RIVAL), key=lambda one: -one[1])


def _parameters(known: Posterior, key: Key, reading: Reading) -> dict[str, Estimate]:
    """Values of the most probable hypothesis; intervals cover those of others with the same effects.

    These hypotheses differ in the signals that drive the effects, or in which body parameters they estimate.
    """
    answer, found = known.answer, dict[str, Estimate]()
    for fit, weight in zip(known.fits, known.weights):
        if fit is not answer and (weight < RIVAL or reading.of(fit) != reading.of(answer)):
            continue
        for name, (term, p) in reading.parameters_of(key, fit.hypothesis.terms).items():
            value, half = term.parameters[name], 0.0
            if p in term.free:
                half = QUANTILE * fit.deviation(f"{term.effect.id}@{term.at}.{name}")
            low, high = max(value - half, p.lower), min(value + half, p.upper)
            before = found.get(name)
            if before is not None:
                low, high = min(low, before.ci95[0]), max(high, before.ci95[1])
            if before is None or fit is answer:
                found[name] = Estimate(value, (low, high), reading.unit(key, p))
            else:
                found[name] = replace(before, ci95=(low, high))
    return found


def _gain(found: Search[Any], fit: Fit, key: Key, reading: Reading) -> float:
    """Fraction of the held-out error that an effect removes, relative to the same hypothesis without it."""
    less = reading.of(fit) - {key}
    others = [one for one in found.made.values() if reading.of(one) == less]
    if not others:
        return 0.0
    held_out = np.ix_(~found.data.fitted_blocks, reading.channels(key))
    errors = [
        one.errors[held_out] / fit.sigma[held_out[1]] ** 2 for one in (max(others, key=found.gain), fit)
    ]
    before, after = (float(one.sum()) for one in errors)
    return 1.0 - float(np.sqrt(after / before)) if before > 0.0 else 0.0
