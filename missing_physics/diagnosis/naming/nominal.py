"""Whether the nominal robot's own numbers are wrong, and which.

Mass properties, torque scale and the parameters of effects that the robot already has are re-estimated with
every explanation. That alone does not make them findings: somebody may have tuned them to this very
recording without the missing effect, and then putting the effect back moves them. So a number of the nominal
robot is called wrong only if re-estimating the nominal robot, with nothing added, already lowers the error
(a tuned robot cannot be improved so), and if it is still needed beside what was found. Where freeing all of
them at once costs more than it gains, one that betters the nominal robot alone counts, if it is the same one
that is needed beside what was found, or if it explains more there than all of them together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from missing_physics.diagnosis.candidates.effects import OF_THE_NOMINAL, candidates, first_look, ranked
from missing_physics.diagnosis.candidates.fitted import present, slim, whole
from missing_physics.diagnosis.least_squares.explanation import Explanation, View, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.naming.search import ODDS, Progress, Search, cut_off, incredible
from missing_physics.diagnosis.statistics.correlated_errors import paired_block_p_value
from missing_physics.diagnosis.terms.real_bodies import unreal
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Rung

__all__ = ["NominalCheck", "check_nominal"]

#: Largest p-value of the held-out gain by which the nominal robot counts as improvable on its own.
HELD_OUT = 0.05
#: Effects that free inertial numbers can imitate, so that they are seen only where those are kept.
ABSORBED = frozenset({"gravity", "sensor_offset", "sensor_gain"})
#: Candidates that are fitted in full, each time.
FITTED = 5
#: Wrong numbers named at most.
MOST_NAMED = 4
#: Words of the ladder.
NEEDLESS = "left out again: the wrong number of the nominal robot explains it as well"


@dataclass(frozen=True)
class NominalCheck:
    """Result of `check_nominal`.

    Attributes:
        wrong: terms that say which numbers are wrong: effects of the catalogue, or effects of the nominal
            robot with new parameters.
        explanation: the fit with those, or the one that came in when there are none.
        ladder: what was weighed.
        free: whether the inertial combinations are free in it.
    """

    wrong: tuple[Term, ...]
    explanation: Explanation
    ladder: tuple[Rung, ...]
    free: bool


#: Evidence, the explanation and what was changed in it.
Trial = tuple[float, Explanation, Term]


def check_nominal(problem: Problem, view: View, search: Search, progress: Progress) -> NominalCheck:
    """Find wrong numbers of the nominal robot beside the effects that `search` found."""
    frozen = tuple(replace(t, frozen=True) for t in _as_given(search))
    untouched = explain(problem, view, frozen, nuisance=False)
    alone = None
    if not _improves(search.start, untouched):
        alone = _best(problem, view, untouched, progress)
        if alone is None:
            return NominalCheck((), search.best, (), free=True)
    replaced = {t.effect.family for t in search.best.found if t.effect.family} or set()
    kept = [t for t in frozen if t.effect.family is None or t.effect.family not in replaced]
    current = explain(problem, view, [*kept, *search.best.found], nuisance=False)
    ladder: list[Rung] = []
    wrong: list[Term] = []
    for _ in range(MOST_NAMED):
        trial = _best(problem, view, current, progress)
        if trial is None:
            break
        after, term, evidence = trial
        another = alone is not None and not wrong and term.key != alone[1].key
        # Tuning moves many numbers: one that does more than all of them together was not tuned away.
        if another and after.evidence_over(search.best) < np.log(ODDS):
            return NominalCheck((), search.best, tuple(ladder), free=True)
        held = paired_block_p_value(current.regression.held_out_energy(), after.regression.held_out_energy())
        kept_it = held <= HELD_OUT and present(after, term)
        ladder.append(_rung(after, current, term, evidence, kept_it))
        if not kept_it:
            break
        wrong.append(term)
        current = after
    current, wrong = _one_for_two(problem, view, current, wrong, ladder)
    current = _without_needless(problem, view, current, wrong, ladder)
    if not wrong or search.best.evidence_over(current) > np.log(ODDS):
        return _many_wrong(problem, view, search.best, frozen, ladder)
    names = {t.key for t in wrong}
    told = replace(
        current, terms=tuple(replace(t, nominal=t.nominal and t.key not in names) for t in current.terms)
    )
    return NominalCheck(tuple(t for t in told.terms if t.key in names), told, tuple(ladder), free=False)


def _one_for_two(
    problem: Problem, view: View, current: Explanation, wrong: Sequence[Term], ladder: list[Rung]
) -> tuple[Explanation, list[Term]]:
    """Put one change in the place of two where it does as much with fewer numbers, as long as there is one.

    Numbers come in one at a time. Where two are wrong, a third may explain most of both and come in first:
    a gain of the torque beside another mass comes out as three changes.
    """
    named = list(wrong)
    for one, other in combinations(wrong, 2):
        if one not in named or other not in named:
            continue
        rest = explain(problem, view, current.terms_without(one), nuisance=False)
        rest = explain(problem, view, rest.terms_without(other), nuisance=False)
        trials = [
            trial
            for term, terms in _changes(problem, view, rest)[0]
            if term.key not in (one.key, other.key)
            and (trial := _fitted(problem, view, current, term, terms)) is not None
        ]
        evidence, after, fresh = max(trials, key=lambda item: item[0], default=(0.0, current, one))
        if evidence > 0.0 and present(after, fresh):
            ladder.append(_rung(after, current, fresh, evidence, True))
            current, named = after, [t for t in named if t.key not in (one.key, other.key)] + [fresh]
    return current, named


def _without_needless(
    problem: Problem, view: View, current: Explanation, wrong: Sequence[Term], ladder: list[Rung]
) -> Explanation:
    """Leave out what was named while every inertial number was free, and is not needed beside `wrong`.

    What these did without while it was there they may have back.
    """
    keys = {term.key for term in wrong}
    for term in [t for t in current.found if t.key not in keys] if wrong else []:
        rest = [whole(t) if t.key in keys else t for t in current.terms if t.key != term.key]
        without = explain(problem, view, rest, nuisance=False)
        for named in wrong:
            without = slim(without, named.key)
        evidence = current.evidence_over(without)
        if evidence < np.log(ODDS):
            ladder.append(replace(_rung(without, current, term, -evidence, False), why=NEEDLESS))
            current = without
    return current


def _many_wrong(
    problem: Problem, view: View, best: Explanation, given: Sequence[Term], ladder: list[Rung]
) -> NominalCheck:
    """Effects of the nominal robot whose parameters must change, when a few numbers do not explain it all.

    Each is held at the parameters of the robot file while everything else is fitted again.
    """
    wrong: set[tuple[str, str]] = set()
    for held in given:
        if all(t.key != held.key for t in best.terms):
            continue
        terms = [held if t.key == held.key else t for t in best.terms]
        evidence = best.evidence_over(explain(problem, view, terms))
        if evidence > np.log(ODDS * len(given)):
            wrong.add(held.key)
            ladder.append(_rung(best, best, held, evidence, True))
    if not wrong:
        return NominalCheck((), best, tuple(ladder), free=True)
    marked = [replace(t, nominal=False) if t.key in wrong else t for t in best.terms]
    explanation = explain(problem, view, marked)
    return NominalCheck(
        tuple(t for t in explanation.terms if t.key in wrong), explanation, tuple(ladder), free=True
    )


def _as_given(search: Search) -> Iterator[Term]:
    """The nominal terms with the parameters of the robot file."""
    own = {(use.effect, use.at): use.parameters for use in search.start.problem.robot.effects}
    for term in search.start.terms:
        yield replace(term, parameters={**term.parameters, **own.get(term.key, {})})


def _improves(fitted: Explanation, untouched: Explanation) -> bool:
    before = untouched.regression.block_energy(np.zeros(untouched.columns.shape[1]))
    gain = paired_block_p_value(before, fitted.regression.held_out_energy())
    return gain <= HELD_OUT and fitted.evidence_over(untouched) > np.log(ODDS)


def _best(
    problem: Problem, view: View, current: Explanation, progress: Progress
) -> tuple[Explanation, Term, float] | None:
    """The change of one nominal number with the strongest evidence, if strong enough."""
    trials: list[Trial] = []

    def fit(term: Term, terms: Sequence[Term]) -> None:
        progress(f"weighing a wrong nominal number: {term.label}")
        if (trial := _fitted(problem, view, current, term, terms)) is not None:
            trials.append(trial)

    changes, others = _changes(problem, view, current)
    for term, terms in changes:
        fit(term, terms)
    if not trials:
        return None
    best = min(trials, key=lambda item: ranked(item[0], item[2]))
    for term in others:  # a first look, which is linear, sees little of a point whose place is unknown
        if term.at == best[2].at and term.effect.id in best[2].effect.simpler:
            fit(term, [*current.terms, term])
    if best[0] < np.log(ODDS * len(trials)):
        return None
    # A special case of it that does about as well says more.
    kin = [t for t in trials if t[2].at == best[2].at and t[2].effect.id in best[2].effect.simpler]
    near = [t for t in kin if t[0] > best[0] - np.log(ODDS)]
    evidence, after, fresh = min(near, key=lambda item: ranked(item[0], item[2]), default=best)
    return after, fresh, evidence


def _fitted(
    problem: Problem, view: View, current: Explanation, term: Term, terms: Sequence[Term]
) -> Trial | None:
    """`terms` fitted, as a change of `current` by `term`; None where that comes out beyond what can be.

    An actuator that lets a tenth of its torque through, on a robot of a tenth of the mass, does all that the
    robot as described does, with a tenth of its errors. A body may have any first moment and no inertia.
    """
    after = slim(explain(problem, view, terms, nuisance=False), term.key)
    fresh = next(t for t in after.terms if t.key == term.key)
    if any(
        t.effect.implausible(t.parameters) or cut_off(t) or incredible(t, problem)
        for t in after.terms
        if not t.frozen
    ):
        return None
    if unreal(problem.robot, fresh):
        return None
    return after.evidence_over(current), after, fresh


def _changes(
    problem: Problem, view: View, current: Explanation
) -> tuple[list[tuple[Term, Sequence[Term]]], list[Term]]:
    """One changed or added term at a time, with the whole set of terms that results.

    And the terms that promise less at a first look.
    """
    changed: list[tuple[Term, Sequence[Term]]] = []
    for term in current.terms:
        if term.frozen and term.effect.along_motion:  # what acts on the whole robot stays as described
            freed = replace(term, frozen=False)
            changed.append((freed, [freed if t.key == term.key else t for t in current.terms]))
    options = list(candidates(problem, current, nominal_numbers=True, among=OF_THE_NOMINAL | ABSORBED))
    looks = [look.candidate.term for look in first_look(problem, view, current, options)]
    changed += [(term, [*current.terms, term]) for term in looks[:FITTED]]
    return changed, looks[FITTED:]


def _rung(after: Explanation, before: Explanation, term: Term, evidence: float, kept: bool) -> Rung:
    rows = after.errors.size
    return Rung(
        effect=term.effect.id,
        location=term.at,
        added_to=tuple(t.label for t in before.terms),
        train_rms=float(np.sqrt((after.errors**2).sum() / rows)),
        validation_rms=after.regression.held_out_rms(rows),
        evidence=evidence,
        kept=kept,
        why="a number of the nominal robot is wrong" if kept else "does not hold in unseen blocks",
    )
