"""What was named while another law stood in its place, and is not needed beside what was found in the end."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from missing_physics.diagnosis.candidates.fitted import whole
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.search import ODDS
from missing_physics.diagnosis.terms.term import Term

__all__ = ["without_needless"]

WHY = "beside what else was found it is not needed"


def without_needless(
    best: Explanation, kept: Collection[tuple[str, str]], *, nuisance: bool
) -> tuple[Explanation, tuple[tuple[Term, str], ...]]:
    """`best` without what the others make superfluous, the least needed first; those terms, and why.

    A name among others stays if the evidence for it still is what a name must bring, and if at least one
    interval of its sizes, as it will be told, leaves "absent" out. Terms whose keys are in `kept` stay,
    unless others with all of their numbers are likelier without them.
    """
    dropped: list[tuple[Term, str]] = []
    while len(best.found) > 1:
        weakest: tuple[float, Term, Explanation] | None = None
        for term in best.found:
            without, richer = _without(best, term, nuisance=nuisance)
            evidence = best.evidence_over(without)
            needless = evidence < np.log(ODDS) or not _told(best, term)
            if term.key in kept:
                needless = richer and evidence < 0
            if needless and (weakest is None or evidence < weakest[0]):
                weakest = evidence, term, without
        if weakest is None:
            break
        evidence, term, best = weakest
        dropped.append((term, f"{WHY} (evidence {evidence:.1f})"))
    return best, tuple(dropped)


def _without(best: Explanation, term: Term, *, nuisance: bool) -> tuple[Explanation, bool]:
    """`best` without a term, and whether others have then what was left out of them while it was there."""
    others = best.terms_without(term)
    plain = explain(best.problem, best.view, others, nuisance=nuisance)
    near = [not t.nominal and (t.at == term.at or "base" in (t.at, term.at)) for t in others]
    richer = [whole(t) if beside else t for t, beside in zip(others, near)]
    if richer == others:
        return plain, False
    more = explain(best.problem, best.view, richer, nuisance=nuisance)
    return (more, True) if more.evidence_over(plain) > 0 else (plain, False)


def _told(best: Explanation, term: Term) -> bool:
    """Whether an interval of its sizes leaves "absent" out."""
    intervals = best.intervals(term)
    sizes = [(p.name, p.absent) for p in term.estimated if p.absent is not None]
    return not sizes or any(not intervals[name][0] <= absent <= intervals[name][1] for name, absent in sizes)
