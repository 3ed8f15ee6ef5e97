"""Search for the hypotheses that predict best, starting from the standard model.

A beam search: every effect at every place is screened as an addition to each of the best few hypotheses, the
most promising ones are fitted, and the best fits form the next round. Then effects that are not needed are
removed, parameters of the standard model are taken from the file where that does not lower the score, and
every remaining effect is compared with its rivals.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import (
    TIMING,
    Candidate,
    Hypothesis,
    Term,
)
from missing_physics.inference.data import Data
from missing_physics.inference.fit import Fit, fitted, residuals, with_other_file_parameters
from missing_physics.inference.ledger import ODDS, D, Search, Step, absent, file_parameters, stated
from missing_physics.inference.score import independent_shares
from missing_physics.inference.screening import Screen, ScreenedCandidate
from missing_physics.plausibility.table import ENCODER_DELAY, TORQUE_DELAY
from reference_model.effects.base import JointEffect

__all__ = ["leading", "search", "standard_search", "try_candidate"]

Array = NDArray[np.float64]

#: Hypotheses in the beam, candidates fitted for each of them, at least so many for each place, most rounds,
#: and rivals fitted for each effect of the answer.
CARRIED, FITTED, PER_PLACE, MOST, RIVALS = 2, 6, 2, 12, 3
#: Rivals whose predicted gain is within this of the best are fitted too, at most twice as many [nats]:
#: probabilities from one in twenty are reported.
CLOSE = 3.0
#: A candidate is fitted where its predicted gain is at least this fraction of `ODDS`.
PROMISE = 0.5

Progress = Callable[[str], None]
#: A parameter of the standard model, or a law of the robot file and one of its parameters.
ParameterName = str | tuple[Term, str]


def search(data: D, progress: Progress | None = None) -> Search[D]:
    """Search for the effects in the recordings that the robot file lacks.

    Args:
        data: the rows.
        progress: called with a phrase whenever something new is tried.
    """
    state = _initial_state(data)
    carried = list(state.made.values())
    for _ in range(MOST):
        best = _pruned(state, _beam_search(state, carried, progress))
        best = _simplified(state, _with_freed_parameters(state, best))
        rival = _compared_with_rivals(state, best, progress)
        if {term.key for term in rival.hypothesis.terms} == {term.key for term in best.hypothesis.terms}:
            break
        carried = [rival]  # it may need other effects beside it
    best = _with_unnamed_forces(state, _with_freed_parameters(state, rival), progress)
    if data.laws:  # effects may have compensated for a fixed law before the unnamed force was added
        best = _with_file_laws(state, best)
    best = _pruned(state, best)
    _with_freed_parameters(state, best)
    best = _all_complete(state)
    data = state.about(best)
    return replace(state, data=data, shares=independent_shares(data, best))


def _all_complete(state: Search[Any]) -> Fit:
    """The best fit, after all parameters of it and of its close rivals were estimated together."""
    while True:
        best = state.score(state.best)
        open_ = [fit for fit in state.made.values() if fit.partial and state.score(fit) > best - CLOSE]
        if not open_:
            return state.best
        for fit in open_:
            state.settled(fit)


def standard_search(data: D) -> Search[D]:
    """The search before anything is tried: the fit of the standard model.

    The common delay of all torques is estimated first, then the additional delays of single joints.
    """
    state = _linearised_search(data, Hypothesis().taking_from_file(*data.delays))
    if not _is_possible(data, state.standard):
        state = _linearised_search(data, _without_delays(data, Hypothesis()))
    state.standard = state.settled(_with_possible_delays(state, Hypothesis(), state.standard))
    return state


def _initial_state(data: D) -> Search[D]:
    """The initial fits: the standard model, with and without parameters taken from the robot file.

    Both also with the file's friction laws, if any.
    """
    state = standard_search(data)
    made, standard = tuple(state.made.values()), state.standard
    known = _with_laws(data)
    held = {name for name, _ in known.held}
    file = known.taking_from_file(*(name for name in file_parameters(data) if name not in held))
    starts = [*made, state.keep(_fitted(state, file, standard))]
    if data.laws:
        starts.append(state.settled(_with_possible_delays(state, known, standard)))
    plain = _simplified(state, max(state.made.values(), key=state.score))
    state.made = {fit.hypothesis.key: fit for fit in (*starts, plain)}
    return state


def _with_laws(data: Data) -> Hypothesis:
    """The standard model with the friction laws of the robot file."""
    found = Hypothesis()
    for law in data.laws:
        found = law.added_to(found)
    return found


def _linearised_search(data: D, hypothesis: Hypothesis) -> Search[D]:
    """The search state with rows linearised at the fit of one hypothesis, which is the standard fit."""
    first = fitted(data, hypothesis)
    about = data.about(first.parameters)
    first = fitted(about, hypothesis, first)
    state = Search(about, first, {}, independent_shares(about, first))
    state.standard = state.settled(first)
    return state


def _fitted(state: Search[Any], hypothesis: Hypothesis, start: Fit | None, place: str | None = None) -> Fit:
    """Fit a hypothesis to rows linearised at the start, from which it differs at one place."""
    return fitted(state.data if start is None else state.about(start), hypothesis, start, place)


def _with_possible_delays(
    state: Search[Any], hypothesis: Hypothesis, start: Fit | None = None, place: str | None = None
) -> Fit:
    """The fit, or the fit without delays if the estimated delays are impossible."""
    fit = _fitted(state, hypothesis, start, place)
    if _is_possible(state.data, fit):
        return fit
    return _fitted(state, _without_delays(state.data, hypothesis), start, place)


def _is_possible(data: Data, fit: Fit) -> bool:
    """Whether the delays of a fit are within the plausible range."""
    if not data.delays:
        return True
    common = sum(map(fit.parameter, data.timing))
    own = [common + fit.parameter(name) for name in data.delays]
    return min(own) >= -ENCODER_DELAY and max(own) <= TORQUE_DELAY


def _without_delays(data: Data, hypothesis: Hypothesis) -> Hypothesis:
    return hypothesis.taking_from_file(*data.timing, *data.delays)


def _beam_search(state: Search[Any], carried: Sequence[Fit], progress: Progress | None) -> Fit:
    """The best fit found by a beam search that adds effects one at a time."""
    for _ in range(MOST):
        before = max(map(state.score, carried))
        new = [fit for old in carried for fit in _extensions(state, old, progress)]
        best = sorted([*carried, *new], key=state.score, reverse=True)[:CARRIED]
        best = sorted(map(state.settled, best), key=state.score, reverse=True)
        if not new or state.score(best[0]) <= before:
            break
        carried, state.shares = best, independent_shares(state.about(best[0]), best[0])
    return max(carried, key=state.score)


def _extensions(state: Search[Any], old: Fit, progress: Progress | None) -> list[Fit]:
    """New credible fits with one more effect, and one with the best effect of every place at once."""
    new: list[Fit] = []
    best: dict[str, tuple[float, Candidate]] = {}
    for option in _promising(_screened(state, old)):
        hypothesis, here = option.candidate.added_to(old.hypothesis), _local_key(option.candidate, old)
        if hypothesis.key in state.made or here in state.futile:
            continue
        fit = try_candidate(state, option.candidate, hypothesis, old)
        if fit is None or state.score(fit) <= state.score(old):
            state.futile.add(here)
        if fit is None:
            continue
        new.append(fit)
        if progress:
            progress(f"{option.candidate.term.effect.title} at {option.candidate.term.at}")
        gain, place = state.score(fit) - state.score(old), option.candidate.term.joint
        if gain > best.get(place, (0.0, None))[0]:
            best[place] = gain, option.candidate
    if len(best) > 1:
        hypothesis = old.hypothesis
        for _, candidate in best.values():
            hypothesis = candidate.added_to(hypothesis)
        fit = try_candidate(state, next(iter(best.values()))[1], hypothesis, old, everywhere=True)
        new += [] if fit is None else [fit]
    return new


def _local_key(candidate: Candidate, old: Fit) -> tuple[object, ...]:
    """Key of a candidate and the terms at its joint in a fit; joints hardly interact."""
    term = candidate.term
    neighbours = (own for own in old.hypothesis.terms if own.joint == term.joint)
    neighbour_keys = sorted((*own.key, own.along, *sorted(own.freed), *own.added) for own in neighbours)
    return (*term.key, term.run, term.along, *term.added, *neighbour_keys)


def _promising(screened: Sequence[ScreenedCandidate]) -> list[ScreenedCandidate]:
    """The candidates to be fitted: some for every place, since effects hardly show at other joints."""
    places = {option.candidate.term.joint for option in screened}
    most, counts = max(PER_PLACE, FITTED // max(len(places), 1)), dict.fromkeys(places, 0)
    chosen = []
    for option in leading(screened):
        place = option.candidate.term.joint
        if option.gain >= PROMISE * ODDS and counts[place] < most:
            counts[place] += 1
            chosen += [
                other for other in screened if _is_same(other, option) and other.gain >= PROMISE * ODDS
            ]
    return chosen


def _is_same(one: ScreenedCandidate, other: ScreenedCandidate) -> bool:
    """Whether two candidates are the same effect, regardless of the signal that drives it."""
    own, theirs = one.candidate.term, other.candidate.term
    return (own.key, own.run) == (theirs.key, theirs.run)


def leading(screened: Sequence[ScreenedCandidate]) -> list[ScreenedCandidate]:
    """For every effect at every place, the candidate with the most promising driving signal."""
    best: dict[tuple[object, ...], ScreenedCandidate] = {}
    for option in screened:
        best.setdefault((option.candidate.term.key, option.candidate.term.run), option)
    return list(best.values())


def _screened(
    state: Search[Any], old: Fit, instead: Term | None = None, *, named: bool = True
) -> Sequence[ScreenedCandidate]:
    """Screened candidates that may be added to a fit, most promising first; cached.

    Args:
        state: the fits made so far.
        old: the fit to which they are added.
        instead: an effect whose rivals only are wanted.
        named: whether known effects are wanted, or else unnamed forces.
    """
    which = id(old), named, "" if instead is None else instead.joint
    fit, shares, known = state.screened.get(which, (None, None, ()))
    if fit is not old or shares is not state.shares:
        known = _screen(state, old, lambda one: _is_named(one) == named and _is_rival(state, one, instead))
        state.screened[which] = old, state.shares, known
    return known


def _screen(state: Search[Any], old: Fit, wanted: Callable[[Candidate], bool]) -> list[ScreenedCandidate]:
    data = state.about(old)
    residual = [
        np.where(data.fitted_rows(i)[:, None], residuals(data, old, i), 0.0) for i in range(data.fitted)
    ]
    options = data.candidates(old.hypothesis, old.parameters, residual)
    return Screen(data, old, state.shares).best([one for one in options if wanted(one)])


def _is_named(candidate: Candidate) -> bool:
    return not candidate.term.effect.is_unknown


def _is_rival(state: Search[Any], candidate: Candidate, term: Term | None) -> bool:
    """Whether a candidate may explain the same residual as a term; local effects show at one joint only."""
    if term is None:
        return True
    is_local = _is_local(state, candidate.term) and _is_local(state, term)
    return candidate.term.at == term.at or not is_local


def _delay_may_explain(state: Search[Any], delay: str, term: Term) -> bool:
    """Whether a delay may explain the same residual as a term: for a local term, that of its joint."""
    return delay.split(".")[0] == term.joint or not _is_local(state, term)


def _is_local(state: Search[Any], term: Term) -> bool:
    """Whether a term acts on the torque of its own joint only."""
    return isinstance(term.effect, JointEffect) and term.at in state.data.joints


def try_candidate(
    state: Search[Any], candidate: Candidate, hypothesis: Hypothesis, old: Fit, *, everywhere: bool = False
) -> Fit | None:
    """The fit with a candidate; None where it is impossible or explains nothing.

    Args:
        state: the fits made so far.
        candidate: the candidate.
        hypothesis: with the candidate.
        old: the fit without it.
        everywhere: whether the two differ at other places, too.
    """
    data = state.data
    if candidate.term.effect.adds_coordinates:
        hypothesis = _begun_nearby(state, candidate.term, hypothesis)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # such a fit has no finite error
            fit = _with_possible_delays(state, hypothesis, old, None if everywhere else candidate.term.joint)
            if candidate.term.effect.adds_coordinates:  # they follow from the bodies, which the term changes
                fit = state.settled(fit, whole=False)
    except np.linalg.LinAlgError:
        return None
    for key, why in fit.impossible.items():
        is_new = key == candidate.term.key and not candidate.term.is_given
        if is_new and state.gain(fit) > state.score(old):
            state.dismissed.setdefault(key, why)
        return None
    if not np.all(np.isfinite(fit.errors)) or not _is_significant(data, fit, old):
        return None
    if not candidate.term.is_given:
        state.steps.append(Step(candidate.term.key, fit, old))
    return state.keep(fit)


def _begun_nearby(state: Search[Any], term: Term, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with a term that starts from the best fit of another hypothesis with it, if any."""
    others = [fit for fit in state.made.values() if term.key in {own.key for own in fit.hypothesis.terms}]
    if not others:
        return hypothesis
    best = max(others, key=state.score).hypothesis.terms
    values = next(own.parameters for own in best if own.key == term.key)
    terms = (own.moved(values) if own.key == term.key else own for own in hypothesis.terms)
    return replace(hypothesis, terms=tuple(terms))


def _is_significant(data: Data, fit: Fit, old: Fit) -> bool:
    """Whether a fit removes more than the error of any model at some joint in some block."""
    removed = (old.errors - fit.errors) / np.maximum(data.counts, 1.0)
    return bool(np.any(removed > data.error**2))


def _pruned(state: Search[Any], best: Fit) -> Fit:
    """The fit without effects whose removal does not lower the score."""
    while best.hypothesis.terms:
        fewer = [_without(state, best, term) for term in best.hypothesis.terms]
        fewer += [
            _without_optional(state, best, term, name)
            for term in best.hypothesis.terms
            for name in term.added
        ]
        top = max(fewer, key=state.score)
        if state.score(top) <= state.score(best):
            break
        best = top
    return best


def _without(state: Search[Any], best: Fit, term: Term) -> Fit:
    hypothesis = best.hypothesis.less(term)
    return state.known(
        hypothesis, best, lambda: state.settled(_fitted(state, hypothesis, best, term.joint), whole=False)
    )


def _without_optional(state: Search[Any], best: Fit, term: Term, name: str) -> Fit:
    """The fit without an optional parameter of a term."""
    terms = tuple(one.lacking(name) if one is term else one for one in best.hypothesis.terms)
    hypothesis = replace(best.hypothesis, terms=terms)
    return state.known(hypothesis, best, lambda: state.keep(_fitted(state, hypothesis, best)))


def _with_file_laws(state: Search[Any], best: Fit) -> Fit:
    """The best fit after trying each friction law of the robot file that a fit lacks."""
    lacking = absent(state.data, best.hypothesis)
    for option in _screened(state, best):
        hypothesis = option.candidate.added_to(best.hypothesis)
        if option.candidate.term in lacking and hypothesis.key not in state.made:
            try_candidate(state, option.candidate, hypothesis, best)
    return state.best


def _changed_terms(fit: Fit) -> tuple[Term, ...]:
    """Terms that differ from the robot file."""
    return tuple(term for term in fit.hypothesis.terms if not term.is_given or term.freed)


def _compared_with_rivals(state: Search[Any], best: Fit, progress: Progress | None) -> Fit:
    """The best fit after comparing every effect with its best rivals until no exchange improves the score.

    After an exchange, effects that interact with it are compared first; in the end all are, with one fit.
    """
    compared: set[tuple[object, ...]] = set()
    for _ in range(MOST):
        if progress:
            progress("comparing effects with their rivals")
        every = {_surroundings(state, best, term): term for term in _changed_terms(best)}
        fresh = every.keys() - compared
        for key, term in every.items():
            if key in fresh:
                _compare_with_rivals(state, best, term)
        compared |= fresh
        _exchange_parameters(state, best)
        top = state.settled(state.best)
        if top is best and len(fresh) == len(every):
            break
        if top is best:
            compared.clear()
        best = top
    return best


def _compare_with_rivals(state: Search[Any], best: Fit, term: Term) -> None:
    """Fit the best rivals of one effect, and the delays that may replace it."""
    less = _without(state, best, term)
    for name in state.data.delays:  # a delay is a parameter, not a term
        if name in less.hypothesis.from_file and _delay_may_explain(state, name, term):
            _with_estimated(state, less, name)
    every = _screened(state, less, term)
    screened = [one for one in leading(every) if one.candidate.term.key != term.key]
    close = [one for one in screened if one.gain > screened[0].gain - CLOSE]
    same = [one for one in every if _has_other_signal(one.candidate.term, term)]
    for option in (*screened[: max(RIVALS, min(len(close), 2 * RIVALS))], *same):
        hypothesis = option.candidate.added_to(less.hypothesis)
        if option.gain >= PROMISE * ODDS and hypothesis.key not in state.made:
            try_candidate(state, option.candidate, hypothesis, less)


def _surroundings(state: Search[Any], fit: Fit, term: Term) -> tuple[object, ...]:
    """Key of a term and those that interact with it: at its joint, or at no single joint."""
    others = fit.hypothesis.terms
    near = (one for one in others if one.joint == term.joint or not _is_local(state, one))
    keys = sorted((*one.key, one.along, *sorted(one.freed), *one.added) for one in near)
    return (*term.key, term.run, term.along, *keys)


def _exchange_parameters(state: Search[Any], best: Fit) -> None:
    """Fit effects that replace a parameter that the robot file lacks, such as laws of dry friction.

    They cost no more than what they replace, so even those that predict as well are rivals. A delay is itself
    reported as one of the effects that replace it.
    """
    differing = {name for name in stated(state.data, best.hypothesis) if not name.endswith(TIMING)}
    for option in leading(_screened(state, best)):
        hypothesis = option.candidate.added_to(best.hypothesis)
        replaces = differing.intersection(name for name, _ in option.candidate.held)
        if replaces and option.gain > -CLOSE and hypothesis.key not in state.made:
            try_candidate(state, option.candidate, hypothesis, best)


def _has_other_signal(term: Term, than: Term) -> bool:
    """Whether a term is the same effect driven by another signal."""
    return term.key == than.key and term.along != than.along


def _with_unnamed_forces(state: Search[Any], best: Fit, progress: Progress | None) -> Fit:
    """The best fit after trying unnamed forces in addition to the effects, and instead of each of them."""
    if progress:
        progress("searching for forces without a name")
    starts = [best, *(_without(state, best, term) for term in _changed_terms(best))]
    starts += [_without_all(state, best, own) for own in _at_each_joint(best) if len(own) > 1]
    for start in starts:
        for option in _screened(state, start, named=False)[:RIVALS]:
            hypothesis = option.candidate.added_to(start.hypothesis)
            if option.gain >= PROMISE * ODDS and hypothesis.key not in state.made:
                try_candidate(state, option.candidate, hypothesis, start)
    return state.best


def _at_each_joint(fit: Fit) -> list[list[Term]]:
    """Terms that differ from the robot file, by their joint."""
    found: dict[str, list[Term]] = {}
    for term in _changed_terms(fit):
        found.setdefault(term.joint, []).append(term)
    return list(found.values())


def _without_all(state: Search[Any], best: Fit, terms: Sequence[Term]) -> Fit:
    """The fit without several terms."""
    for term in terms:
        best = _without(state, best, next(own for own in best.hypothesis.terms if own.key == term.key))
    return best


def _simplified(state: Search[Any], best: Fit) -> Fit:
    """The fit with parameters from the robot file and without delays, where that does not lower the score."""
    data = state.data

    def with_file_value(of: Fit, name: ParameterName) -> Fit:
        if isinstance(name, tuple):  # a law's parameter, in which torques are not linear
            hypothesis = of.hypothesis.restoring(*name)
            return state.known(hypothesis, of, lambda: state.settled(_fitted(state, hypothesis, of)))
        return _with_parameter_source(state, of.hypothesis.taking_from_file(name), of, name)

    while True:
        held = {name for name, _ in best.hypothesis.held} | best.hypothesis.from_file
        names: list[ParameterName] = [
            name for name in (*file_parameters(data), *data.timing) if name not in held
        ]
        names += best.hypothesis.freed
        alone = {name: state.score(with_file_value(best, name)) - state.score(best) for name in names}
        before = best
        for name in sorted(names, key=lambda n: -alone[n]):
            if alone[name] > -ODDS:
                trial = with_file_value(best, name)
                best = trial if state.score(trial) > state.score(best) else best
        if best is before:
            return best
        best = state.keep(_fitted(state, best.hypothesis, best))


def _with_freed_parameters(state: Search[Any], best: Fit) -> Fit:
    """The fit with parameters estimated where the robot file's value lowers the score."""
    for name in sorted(best.hypothesis.from_file):
        trial = _with_estimated(state, best, name)
        best = trial if state.score(trial) > state.score(best) else best
    return best


def _with_estimated(state: Search[Any], fit: Fit, name: str) -> Fit:
    """The fit that also estimates one parameter so far taken from the robot file."""
    hypothesis = replace(fit.hypothesis, from_file=fit.hypothesis.from_file - {name})
    return _with_parameter_source(state, hypothesis, fit, name)


def _with_parameter_source(state: Search[Any], hypothesis: Hypothesis, start: Fit, name: str) -> Fit:
    """The fit of a hypothesis that differs in whether one parameter is taken from the robot file."""

    def make() -> Fit:
        made = with_other_file_parameters(state.about(start), hypothesis, start)
        return state.settled(made) if name.endswith(TIMING) else state.keep(made)

    return state.known(hypothesis, start, make)
