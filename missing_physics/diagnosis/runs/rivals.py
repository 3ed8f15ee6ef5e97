"""What is run in closed loop in the place of a finding."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates.effects import Candidate, candidates, first_look
from missing_physics.diagnosis.candidates.fitted import refit
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.judge import AMBIGUOUS, Weighed
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import catalogue

__all__ = [
    "HEARD",
    "REGRESSION",
    "RUN",
    "RUN_QUICK",
    "SMALL",
    "richer_laws",
    "rivals",
    "with_equals",
    "without_beaten",
]

Array = NDArray[np.float64]

#: Evidence that a regression can bring for or against a rival: what it takes as known may be wrong.
REGRESSION = 10.0
#: Rivals that are run: of those that cannot be told apart; and others, where the finding leaves more than
#: noise.
RUN, RUN_MORE = 4, 3
#: Of robots whose runs are quick more of those that cannot be told apart.
RUN_QUICK = 10
#: And of an actuator's error where the finding is none, or the other way round.
RUN_SCALED = 3
#: Part of its probability that is left to a rival that runs refused with its best numbers.
BEATEN = float(np.exp(-REGRESSION))
#: A finding whose runs leave no more than this of what differs needs no rival.
SMALL = 0.02
#: A channel is heard where some run leaves this mean square, in units of its noise.
HEARD = 1.5


def without_beaten(
    weighed: Sequence[Weighed],
    beaten: Collection[tuple[str, str]],
    beside: Collection[tuple[str, str]] = (),
) -> tuple[Weighed, ...]:
    """Names with what runs refused hardly probable: even its best numbers do not give what was recorded.

    Args:
        beside: names that were there meanwhile, so that nothing is said of what is in their place.
    """
    kept = []
    for item in weighed:
        if item.term.key in beside:
            kept.append(item)
            continue
        lost = sum(p for term, p in item.alternatives if term.key in beaten) * (1.0 - BEATEN)
        others = ((term, p * BEATEN if term.key in beaten else p) for term, p in item.alternatives)
        kept.append(replace(item, probability=item.probability + lost, alternatives=tuple(others)))
    return tuple(kept)


def with_equals(
    weighed: Sequence[Weighed], name: tuple[str, str], equals: Sequence[tuple[Term, float]]
) -> tuple[Weighed, ...]:
    """Names with what was run in the place of one of them, by its log odds against it, none above nothing.

    A regression that has no such numbers for it may have called it impossible.
    """
    return tuple(_beside(item, equals) if item.term.key == name and equals else item for item in weighed)


def _beside(item: Weighed, equals: Sequence[tuple[Term, float]]) -> Weighed:
    known = {term.key: (term, p) for term, p in item.alternatives}
    for term, odds in equals:
        likely = item.probability * float(np.exp(odds))
        if term.key not in known or known[term.key][1] < likely:
            known[term.key] = (term, likely)
    whole = max(item.probability + sum(p for _, p in known.values()), 1.0)
    others = sorted(((term, p / whole) for term, p in known.values()), key=lambda pair: -pair[1])
    return replace(item, probability=item.probability / whole, alternatives=tuple(others))


def rivals(
    best: Explanation,
    item: Weighed,
    left: float | None,
    energies: Sequence[Array],
    *,
    nuisance: bool,
    most: int = RUN,
) -> Iterator[tuple[tuple[str, str], float, Explanation]]:
    """What is run in a finding's place: its key, the regression's odds for it, and the explanation with it.

    Of those that a regression cannot tell from it, `most` are.

    Beside the rivals that were weighed, where runs leave more than noise, the richer laws of its family.
    The regression refused these or never asked for them: it speaks against them as far as it is heard.
    What took another finding's place meanwhile is there already: no rival any more.
    """
    others = best.terms_without(item.term)
    there = {term.key for term in others}
    for rival, probability in _worth_running(item, left, most):
        if rival.key in there:
            continue
        odds = float(np.log(max(probability, 1e-300) / max(item.probability, 1e-300)))
        trial = explain(best.problem, best.view, [*others, rival], nuisance=nuisance)
        yield rival.key, float(np.clip(odds, -REGRESSION, REGRESSION)), trial
    if max(float(e.max()) for e in energies) <= HEARD:
        return
    known = {term.key for term, _ in item.alternatives}
    options = [c for c in richer_laws(best, [item.term]) if c.term.key not in known]
    for look in first_look(best.problem, best.view, best, options):
        trial = refit(best.problem, best.view, best, look.candidate, nuisance=nuisance)
        yield look.candidate.term.key, -REGRESSION, trial


def richer_laws(best: Explanation, terms: Sequence[Term]) -> list[Candidate]:
    """Richer laws of the families of some names, each in the place of one."""
    laws, keys = catalogue().values(), {term.key for term in terms}
    families = [(term.effect.family, term.effect.rung) for term in terms if term.effect.family]
    richer = {e.id for e in laws for family, rung in families if e.family == family and e.rung > rung}
    options = candidates(best.problem, best, bristles=True, among=richer)
    return [c for c in options if c.replaces is not None and c.replaces.key in keys]


def _worth_running(item: Weighed, left: float | None, most: int) -> list[tuple[Term, float]]:
    """Rivals that cannot be told apart; and, where runs leave much, the likeliest others.

    Of an actuator's error and something else a regression knows little: it has to know just how much of the
    noise goes through the actuator. A drive's gain does what a wrong mass does, which it may call impossible.
    """
    order = sorted(item.alternatives, key=lambda pair: -pair[1])
    equal = [pair for pair in order if pair[1] >= AMBIGUOUS * item.probability][:most]
    scaled = [pair for pair in order if pair[0].scales_torque != item.term.scales_torque]
    equal += [pair for pair in scaled[:RUN_SCALED] if pair not in equal]
    if left is None or left <= SMALL:
        return equal
    return equal + [pair for pair in order if pair not in equal][:RUN_MORE]
