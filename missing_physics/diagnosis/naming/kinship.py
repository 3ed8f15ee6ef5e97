"""Laws of one family at one joint, of which the data may favour one only a little: odds, not a verdict.

The ladder of a family asks for strong evidence before a richer law takes the place of a simpler one, and
reversals for more. That keeps names from being exchanged by chance; it does not make the law that was refused
improbable. So at the end every law of the family that may stand in the place of a finding is weighed against
it by what the fitted and the held-out data say together: the evidence (which pays for the numbers that a law
has more) and the logarithm of the likelihood ratio in the data that no fit has touched. What was refused is
as probable as the one that stands at most.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates.effects import candidates, first_look
from missing_physics.diagnosis.candidates.fitted import present, refit, uninformed
from missing_physics.diagnosis.least_squares.explanation import Explanation, View, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.naming.search import cut_off
from missing_physics.diagnosis.preparation.proof import HeldOut
from missing_physics.diagnosis.statistics.correlated_errors import effective_samples
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import catalogue

__all__ = [
    "REFUSED",
    "Contested",
    "contested",
    "evidence_by_parts",
    "law_at",
    "odds_for",
    "saved",
    "static_laws",
]

Array = NDArray[np.float64]

#: Logarithm of the likelihood ratio in held-out data below which they refuse a law: twenty to one against it.
REFUSED = -3.0
#: Independent numbers that errors around one reversal hold at most.
PER_REVERSAL = 2.0
#: Keeps logarithms of energies finite.
TINY = 1e-300


@dataclass(frozen=True)
class Contested:
    """Two laws of one family in the same rows, everything else fitted alike.

    Attributes:
        stands: the one that the explanation holds.
        other: the one in whose place it is, or that was refused.
        evidence: for the one that stands, fitted and held-out data together; natural logarithm of odds.
    """

    stands: Term
    other: Term
    evidence: float


def odds_for(after: Explanation, before: Explanation, held_out: HeldOut) -> float:
    """Natural logarithm of the odds for `after` against `before`, by fitted and held-out data together.

    Both must be of one view. Nothing was fitted to held-out data, so that no number costs anything there.
    """
    return evidence_by_parts(after, before) + _gain(
        before.view, held_out.problem, held_out.rows, *(held_out.residual(e) for e in (before, after))
    )


def evidence_by_parts(after: Explanation, before: Explanation) -> float:
    """Evidence for `after`, rows around reversals and others each with a noise level of their own.

    At a reversal the smoothed velocity changes its sign a little before or after the joint does, so that what
    any law leaves there may be ten times what it leaves elsewhere. Counted with one noise level for all, the
    few rows that hold nearly all of the energy would speak for the number of all rows. What a wrong instant
    leaves is a pulse: one reversal says two numbers, when and how long, in however many rows.
    """
    problem, view = before.problem, before.view
    effective = max(float(after.effective.sum()), 2.0)
    gain = _gain(view, problem, view.rows, before.residual, after.residual)
    return gain - 0.5 * (after.size - before.size) * float(np.log(effective))


def saved(after: Explanation, before: Explanation) -> float:
    """What the numbers of `after` cost less than in `evidence_by_parts` where few rows tell them.

    A number costs half the logarithm of the samples that tell it, not of all (Berger, Bayarri and Pericchi,
    Econometric Reviews 33 (2014) 197-217): what happens near rest is not known to be absent because a joint
    moved fast for long.
    """
    effective = max(float(after.effective.sum()), 2.0)
    both = (_told_by(e, effective) for e in (after, before))
    own, other = (float(np.log(np.minimum(n, effective) / effective).sum()) for n in both)
    return 0.5 * (other - own)


def _told_by(explanation: Explanation, effective: float) -> Array:
    """Effective samples that tell each number: as many as hold the energy of its column, shape (K,)."""
    squares = explanation.columns**2
    rows = float((explanation.errors != 0).sum())
    alike = squares.sum(0) ** 2 / np.maximum((squares**2).sum(0), TINY)
    return np.asarray(np.maximum(alike * effective / max(rows, 1.0), 2.0))


def _gain(view: View, problem: Problem, rows: NDArray[np.bool_], before: Array, after: Array) -> float:
    """Logarithm of the likelihood ratio of two residuals, shape (R, m); each part has its own noise."""
    usable = problem.usable
    weight = view.weight(problem)[rows][:, usable] > 0
    sliding = (problem.sliding[rows][:, usable] > 0) & weight
    gain = 0.0
    for k, (one, other) in enumerate(zip(before[rows][:, usable].T, after[rows][:, usable].T)):
        share = effective_samples(other * weight[:, k]) / max(other.size, 1)
        near = weight[:, k] & ~sliding[:, k]
        turns = int(np.count_nonzero(np.diff(near.astype(int), prepend=0) == 1))
        counts = share * float(sliding[:, k].sum()), min(share * float(near.sum()), PER_REVERSAL * turns)
        for part, count in zip((sliding[:, k], near), counts):
            energies = (max(float((e[part] ** 2).sum()), TINY) for e in (one, other))
            gain += 0.5 * count * float(np.log(next(energies) / next(energies)))
    return gain


def contested(
    best: Explanation, held_out: HeldOut, known: Sequence[Contested] = (), *, nuisance: bool
) -> tuple[Contested, ...]:
    """For every found law of a family those of the same family that no reversal is needed for.

    Args:
        known: what the reversals have weighed already.
    """
    done = {(c.stands.key, c.other.key) for c in known}
    found = list(known)
    for term in best.found:
        if term.effect.family is None or term.frozen:
            continue
        for other in static_laws(best, term, nuisance=nuisance):
            fresh = law_at(other, term)
            if fresh.key != term.key and (term.key, fresh.key) not in done:
                odds, evidence = odds_for(other, best, held_out), evidence_by_parts(other, best)
                if odds - evidence > REFUSED:
                    found.append(Contested(term, fresh, -odds - saved(other, best)))
    return tuple(found)


def law_at(explanation: Explanation, term: Term) -> Term:
    """The law of the family of `term` that an explanation has in its place."""
    return next(t for t in explanation.terms if t.at == term.at and t.effect.family == term.effect.family)


def static_laws(best: Explanation, term: Term, *, nuisance: bool) -> Iterator[Explanation]:
    """`best` with each law of the family of `term` in its place that has no state and makes sense there."""
    problem, view = best.problem, best.view
    low = _lowest(best, term, nuisance=nuisance)
    yield low
    lowest = law_at(low, term)
    richer = [o for o in candidates(problem, low) if o.replaces is not None and o.replaces.key == lowest.key]
    for look in first_look(problem, view, low, richer):
        trial = refit(problem, view, low, look.candidate, nuisance=nuisance)
        fresh = law_at(trial, term)
        nonsense = fresh.effect.implausible(fresh.parameters) or uninformed(trial, fresh) or cut_off(fresh)
        if present(trial, fresh) and not nonsense:
            yield trial


def _lowest(best: Explanation, term: Term, *, nuisance: bool) -> Explanation:
    """`best` with the simplest law of the family in the place of `term`."""
    if term.effect.rung == 1:
        return best
    [simplest] = [e for e in catalogue().values() if e.family == term.effect.family and e.rung == 1]
    level = term.parameters.get("coulomb_torque", 0.0)
    values = {**simplest.defaults(), **{p.name: level for p in simplest.estimated}}
    lowest = replace(term, effect=simplest, parameters=values, narrowed={}, unseen=())
    terms = [lowest if t.key == term.key else t for t in best.terms]
    return explain(best.problem, best.view, terms, nuisance=nuisance)
