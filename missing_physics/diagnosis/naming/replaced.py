"""Effects that were named first and then gave way to another one: whether that is right, and telling it.

A later effect may make an earlier one superfluous. That the earlier one then leaves is decided while the
explanation is still growing. So at the end the two are compared once more, everything else alike and fitted
again with each. Where unseen data do not clearly favour the later one, the earlier stays unless it needs more
numbers, and the two are told as ambiguous. Where they do, the reader is told what gave way, and to what.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from missing_physics.diagnosis.least_squares.explanation import Explanation, View, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.naming.judge import AMBIGUOUS
from missing_physics.diagnosis.preparation.proof import SIGNIFICANCE, HeldOut
from missing_physics.diagnosis.statistics.correlated_errors import paired_block_p_value
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Alternative, Finding

__all__ = ["Contest", "contests_of", "settled", "with_history"]

#: Largest power of e that is told apart from certainty.
CERTAIN = 700.0


@dataclass(frozen=True)
class Contest:
    """Two effects, of which one explanation holds one and a second the other; both fitted alike.

    Attributes:
        earlier, later: in the order in which they were named.
        evidence: for the later.
        p_value: chance of its gain in held-out data if there is none.
        words: the held-out errors with each.
        earlier_stays: whether the explanation holds the earlier one.
    """

    earlier: Term
    later: Term
    evidence: float
    p_value: float
    words: str
    earlier_stays: bool = False


def settled(
    problem: Problem,
    view: View,
    best: Explanation,
    stages: Sequence[Explanation],
    held_out: HeldOut,
    *,
    nuisance: bool,
) -> tuple[Explanation, tuple[Contest, ...]]:
    """`best` with earlier effects back where held-out data do not favour the later; and those contests."""
    kept = []
    for earlier, later in _pairs(best, stages):
        if later.effect.is_event:
            continue
        other = _exchanged(problem, view, best, later, earlier, nuisance=nuisance)
        contest = _contest(other, best, earlier, later, held_out)
        if contest.p_value <= SIGNIFICANCE or other.size > best.size:
            continue
        kept.append(replace(contest, earlier_stays=True))
        best = other
    return best, tuple(kept)


def contests_of(
    problem: Problem,
    view: View,
    best: Explanation,
    stages: Sequence[Explanation],
    held_out: HeldOut,
    *,
    nuisance: bool,
) -> tuple[Contest, ...]:
    """The contests that the later effect has won, in the final explanation."""
    return tuple(
        _contest(
            _exchanged(problem, view, best, later, earlier, nuisance=nuisance), best, earlier, later, held_out
        )
        for earlier, later in _pairs(best, stages)
    )


def with_history(findings: Sequence[Finding], contests: Sequence[Contest]) -> tuple[Finding, ...]:
    """Findings that tell what they replaced, or what could not replace them."""
    found = list(findings)
    for contest in contests:
        holder = contest.earlier if contest.earlier_stays else contest.later
        rival = contest.later if contest.earlier_stays else contest.earlier
        for index, finding in enumerate(found):
            if (finding.effect, finding.location) == holder.key:
                found[index] = _told(finding, rival, contest)
    return tuple(found)


def _told(finding: Finding, rival: Term, contest: Contest) -> Finding:
    if contest.earlier_stays:
        # Fitted data favour the one, unseen data do not say so: neither is more probable.
        own = other = min(finding.probability, 0.5)
        why = f"explains the fitted data better, but unseen data do not bear that out: {contest.words}"
    else:
        own = finding.probability
        other = own * float(np.exp(-np.clip(contest.evidence, 0.0, CERTAIN)))
        own -= other / 2.0
        other -= other / 2.0
        why = f"it was named first, then {contest.later.label} took its place: {contest.words}"
    rest = tuple(a for a in finding.alternatives if (a.effect, a.location) != rival.key)
    labels = [label for label in finding.ambiguous_with if label != rival.label]
    if other >= AMBIGUOUS:
        labels.append(rival.label)
    scale = max(own + other + sum(a.probability for a in rest), 1.0)
    own, other = own / scale, other / scale
    rest = tuple(replace(a, probability=a.probability / scale) for a in rest)
    return replace(
        finding,
        probability=own,
        ambiguous_with=tuple(labels),
        alternatives=(Alternative(rival.effect.id, rival.at, other, why), *rest),
    )


def _pairs(best: Explanation, stages: Sequence[Explanation]) -> list[tuple[Term, Term]]:
    """(earlier, later) for every effect that left when another entered which is still there."""
    present = {t.key: t for t in best.found}
    heirs: dict[tuple[str, str], tuple[Term, tuple[str, str]]] = {}
    for before, after in pairwise(stages):
        left = {t.key for t in after.found}
        for term in before.found:
            if term.key not in left and after.found:
                heirs[term.key] = term, after.found[-1].key
    pairs = []
    for key, (term, heir) in heirs.items():
        seen = {key}
        while heir not in present and heir in heirs and heir not in seen:
            seen.add(heir)
            heir = heirs[heir][1]
        if key not in present and heir in present:
            pairs.append((term, present[heir]))
    return pairs


def _exchanged(
    problem: Problem, view: View, best: Explanation, out: Term, into: Term, *, nuisance: bool
) -> Explanation:
    terms = [into if t.key == out.key else t for t in best.terms]
    return explain(problem, view, terms, nuisance=nuisance)


def _contest(
    with_earlier: Explanation, with_later: Explanation, earlier: Term, later: Term, held_out: HeldOut
) -> Contest:
    residuals = held_out.residual(with_earlier), held_out.residual(with_later)
    p_value = paired_block_p_value(*(held_out.block_energies(r) for r in residuals))
    evidence = with_later.evidence_over(with_earlier)
    one, other = (held_out.rms(r, later.at.split(".")[0]) for r in residuals)
    words = (
        f"everything else fitted alike, the held-out error is {one} with {earlier.label} and {other} with "
        f"{later.label} (p = {p_value:.2g})"
    )
    return Contest(earlier, later, evidence, p_value, words)
