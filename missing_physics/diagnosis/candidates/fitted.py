"""One more term in an explanation: fitted, slimmed to what the data tell, and judged present or not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from missing_physics.diagnosis.candidates.effects import Candidate
from missing_physics.diagnosis.least_squares.explanation import Explanation, View, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.base import Parameter

__all__ = ["blind_parameters", "present", "refit", "slim", "uninformed", "whole"]

#: An interval wider than this many times its value says nothing.
UNKNOWN = 4.0
#: or, of a parameter that may be absent, this many times its typical size.
UNHEARD_OF = 1e3
#: Rough intervals of places count as so many times wider.
WIDER = 3.0
#: A parameter whose column is shorter than this part of the longest moves nothing.
UNFELT = 1e-12
#: A column that keeps less than this part of its length beside the others is one of their combinations.
IMITATED = 1e-4


def present(explanation: Explanation, term: Term) -> bool:
    """Whether at least one amplitude of `term` differs from "absent" beyond its 95 % interval."""
    intervals = explanation.rough_intervals(term)
    amplitudes = [p for p in term.estimated if p.absent is not None]
    if not amplitudes:
        return True
    return any(not intervals[p.name][0] <= float(p.absent or 0.0) <= intervals[p.name][1] for p in amplitudes)


def blind_parameters(explanation: Explanation, term: Term, *, told: bool = False) -> tuple[str, ...]:
    """Parameters of a term whose intervals say nothing: those of the search, or those that are `told`."""
    fitted = next(t for t in explanation.terms if t.key == term.key)
    intervals = explanation.intervals(fitted) if told else explanation.rough_intervals(fitted)
    length = np.linalg.norm(explanation.columns[:, explanation.slice_of(fitted)], axis=0)
    moves = length > UNFELT * max(float(np.linalg.norm(explanation.columns, axis=0).max()), 1e-300)
    return tuple(
        p.name
        for p, felt in zip(fitted.estimated, moves)
        if not (felt or p.name in fitted.held)
        or not intervals[p.name][1] - intervals[p.name][0] <= _believable(p, fitted.parameters[p.name])
    )


def _believable(parameter: Parameter, value: float) -> float:
    """Widest interval of a parameter that still says something."""
    if parameter.absent is None:
        return UNKNOWN * abs(value)
    return UNHEARD_OF * max(abs(value), parameter.typical)


def uninformed(explanation: Explanation, term: Term) -> str:
    """The first parameter that a term cannot do without and of which the data say nothing; else empty."""
    essential = term.effect.essential or tuple(p.name for p in term.estimated)
    blind = [name for name in blind_parameters(explanation, term) if name in essential]
    return blind[0].replace("_", " ") if blind else ""


def refit(
    problem: Problem, view: View, current: Explanation, candidate: Candidate, *, nuisance: bool = True
) -> Explanation:
    """Fit the current terms with the candidate added, or put in the place of what it replaces."""
    kept = [t for t in current.terms if candidate.replaces is None or t.key != candidate.replaces.key]
    nominal = candidate.replaces is not None and candidate.replaces.nominal
    added = replace(candidate.term, nominal=False) if nominal else candidate.term
    return slim(explain(problem, view, [*kept, added], nuisance=nuisance), added.key)


def slim(explanation: Explanation, key: tuple[str, str]) -> Explanation:
    """Leave out parameters that cannot be told from "absent", and those of which the data say nothing.

    Of two in order that a fit made equal the greater goes with the smaller.

    At least one that makes the effect remains.
    """
    term = next(t for t in explanation.terms if t.key == key)
    intervals = explanation.rough_intervals(term)
    needless = [
        p.name
        for p in term.estimated
        if p.linear
        and p.absent is not None
        and p.name not in term.effect.essential
        and intervals[p.name][0] <= p.absent <= intervals[p.name][1]
    ]
    if len(needless) == sum(p.absent is not None for p in term.estimated):
        needless = []
    needless += [name for name in _places(term) if _near_nothing(*intervals[name])]
    one = [greater for greater, smaller in term.effect.ordered if _at_each_other(term, greater, smaller)]
    optional = [p.name for p in term.estimated if p.name not in (*term.effect.essential, *needless, *one)]
    unknown = {*blind_parameters(explanation, term), *_imitated(explanation, term, optional)}
    blind = [name for name in optional if term.effect.essential and name in unknown]
    if not needless and not blind and not one:
        return explanation
    absent = {name: float(term.effect.parameter(name).absent or 0.0) for name in needless}
    simpler = replace(
        term, parameters={**term.parameters, **absent}, unseen=(*term.unseen, *needless, *blind, *one)
    )
    terms = [simpler if t.key == key else t for t in explanation.terms]
    slimmed = explain(explanation.problem, explanation.view, terms, nuisance=explanation.nuisance.size > 0)
    return slimmed if slimmed.evidence_over(explanation) > 0 else explanation


def _places(term: Term) -> list[str]:
    """Numbers that an effect can do without and that are as likely on either side of a frame's origin."""
    essential = term.effect.essential
    told = [p for p in term.estimated if p.default == 0.0 and p.absent is None and p.lower < 0 < p.upper]
    return [p.name for p in told if p.name not in essential]


def _near_nothing(low: float, high: float) -> bool:
    """Whether a rough interval, widened, holds zero; evidence decides."""
    return abs(low + high) <= WIDER * (high - low)


def _at_each_other(term: Term, greater: str, smaller: str) -> bool:
    """Whether two free parameters in order are equal: a fit would have put the greater below the smaller."""
    return {greater, smaller} <= set(term.free) and term.same(greater, smaller)


def whole(term: Term) -> Term:
    """`term` with every parameter free that would be zero if it could not be told."""
    left = tuple(p.name for p in term.effect.estimated if p.linear and p.absent is not None)
    if not set(left) & set(term.unseen):
        return term
    return replace(term, unseen=tuple(name for name in term.unseen if name not in left))


def _imitated(explanation: Explanation, term: Term, names: Sequence[str]) -> list[str]:
    """Those of the parameters `names` whose every change other parameters can make as well."""
    length = np.linalg.norm(explanation.columns, axis=0)
    columns = explanation.columns / np.where(length > 0, length, 1.0)
    start, kept = explanation.slice_of(term).start, length > 0
    found = []
    for name in names:
        own = start + term.free.index(name)
        kept[own] = False
        others = columns[:, kept]
        gap = columns[:, own] - others @ np.linalg.lstsq(others, columns[:, own], rcond=1e-10)[0]
        if np.linalg.norm(gap) < IMITATED:
            found.append(name)
        else:
            kept[own] = True
    return found
