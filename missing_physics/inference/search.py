"""From the standard model to the hypotheses that predict best.

A beam search: every effect at every place is screened as an addition to each of the best few hypotheses, the
most promising ones are fitted, and the best fits form the next round. Then effects that are not needed are
removed, parameters of the standard model for which the file's value serves as well are taken from the file,
and every remaining effect is compared with its rivals.
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
from missing_physics.inference.fit import Fit, fitted, refiled, residuals
from missing_physics.inference.ledger import ODDS, D, Search, Step, filable
from missing_physics.inference.score import independent_shares
from missing_physics.inference.screening import Look, Screen
from missing_physics.plausibility.table import ENCODER_DELAY, TORQUE_DELAY
from reference_model.effects.base import JointEffect

__all__ = ["search"]

Array = NDArray[np.float64]

#: Hypotheses in the beam, candidates fitted for each of them, candidates fitted at least for each place, most
#: rounds, and rivals fitted for each effect of the answer.
CARRIED, FITTED, PER_PLACE, MOST, RIVALS = 2, 6, 2, 12, 3
#: Rivals whose predicted gain is within this of the best are fitted too, at most twice as many [nats]: a
#: probability of one in twenty is stated.
CLOSE = 3.0
#: A candidate is fitted where its predicted gain is at least this part of the required one.
PROMISE = 0.5

Said = Callable[[str], None]
#: A parameter of the standard model, or a law of the robot file and one of its parameters.
Number = str | tuple[Term, str]


def search(data: D, progress: Said | None = None) -> Search[D]:
    """Search for the effects that the recordings show beyond the robot file."""
    state = _begun(data)
    best = _grown_up(state, list(state.made.values()), progress)
    best = _pruned(state, best)
    best = _simplified(state, _freed(state, best))
    best = _exchanged(state, best, progress)
    best = _without_names(state, _freed(state, best), progress)
    if data.laws:  # effects that made up for a law that is held, while the force was not there
        best = _pruned(state, best)
    _freed(state, best)
    best = _completed(state)
    data = state.about(best)
    return replace(state, data=data, shares=independent_shares(data, best))


def _completed(state: Search[Any]) -> Fit:
    """The best fit, once it and those within reach of it have all parameters estimated together."""
    while True:
        best = state.score(state.best)
        open_ = [fit for fit in state.made.values() if fit.partial and state.score(fit) > best - CLOSE]
        if not open_:
            return state.best
        for fit in open_:
            state.settled(fit)


def _begun(data: D) -> Search[D]:
    """The standard model, and the standard model with parameters of the robot file where these serve.

    With friction laws in the file, both also with these laws. The common delay of all torques is estimated
    first, then the further delays of single joints.
    """
    state = _taken_about(data, Hypothesis().filing(*data.delays))
    if not _is_possible(data, state.standard):
        state = _taken_about(data, _without_delays(data, Hypothesis()))
    first = state.standard
    standard = state.standard = state.settled(_timed(state, Hypothesis(), first))
    known = _with_laws(data)
    held = {name for name, _ in known.held}
    filed = known.filing(*(name for name in filable(data) if name not in held))
    starts = [first, standard, state.keep(_fitted(state, filed, standard))]
    if data.laws:
        starts.append(state.settled(_timed(state, known, standard)))
    plain = _simplified(state, max(state.made.values(), key=state.score))
    state.made = {fit.hypothesis.key: fit for fit in (*starts, plain)}
    return state


def _with_laws(data: Data) -> Hypothesis:
    """The standard model with the friction laws of the robot file."""
    found = Hypothesis()
    for law in data.laws:
        found = law.added_to(found)
    return found


def _taken_about(data: D, hypothesis: Hypothesis) -> Search[D]:
    """The search state with recordings linearised about one hypothesis, whose fit is the standard."""
    first = fitted(data, hypothesis)
    about = data.about(first.numbers)
    first = fitted(about, hypothesis, first)
    state = Search(about, first, {}, independent_shares(about, first))
    state.standard = state.settled(first)
    return state


def _fitted(state: Search[Any], hypothesis: Hypothesis, start: Fit | None, place: str | None = None) -> Fit:
    """Fit a hypothesis to the recordings linearised about the start, from which it differs at one place."""
    return fitted(state.data if start is None else state.about(start), hypothesis, start, place)


def _timed(
    state: Search[Any], hypothesis: Hypothesis, start: Fit | None = None, place: str | None = None
) -> Fit:
    """The fit, or one without delays where the estimated delays are impossible."""
    fit = _fitted(state, hypothesis, start, place)
    if _is_possible(state.data, fit):
        return fit
    return _fitted(state, _without_delays(state.data, hypothesis), start, place)


def _is_possible(data: Data, fit: Fit) -> bool:
    """Whether the delays of a fit are possible for a recording."""
    if not data.delays:
        return True
    common = sum(map(fit.number, data.timing))
    own = [common + fit.number(name) for name in data.delays]
    return min(own) >= -ENCODER_DELAY and max(own) <= TORQUE_DELAY


def _without_delays(data: Data, hypothesis: Hypothesis) -> Hypothesis:
    return hypothesis.filing(*data.timing, *data.delays)


def _grown_up(state: Search[Any], carried: Sequence[Fit], progress: Said | None) -> Fit:
    """The best fit obtained from some fits by adding effects one at a time."""
    for _ in range(MOST):
        before = max(map(state.score, carried))
        new = [fit for old in carried for fit in _grown(state, old, progress)]
        best = sorted([*carried, *new], key=state.score, reverse=True)[:CARRIED]
        best = sorted(map(state.settled, best), key=state.score, reverse=True)
        if not new or state.score(best[0]) <= before:
            break
        carried, state.shares = best, independent_shares(state.about(best[0]), best[0])
    return max(carried, key=state.score)


def _grown(state: Search[Any], old: Fit, progress: Said | None) -> list[Fit]:
    """New credible fits with one more effect, and then one with the best effect of every place."""
    new: list[Fit] = []
    best: dict[str, tuple[float, Candidate]] = {}
    for look in _promising(_looks(state, old)):
        hypothesis, here = look.candidate.added_to(old.hypothesis), _here(look.candidate, old)
        if hypothesis.key in state.made or here in state.futile:
            continue
        fit = _tried(state, look.candidate, hypothesis, old)
        if fit is None or state.score(fit) <= state.score(old):
            state.futile.add(here)
        if fit is None:
            continue
        new.append(fit)
        if progress:
            progress(f"{look.candidate.term.effect.title} at {look.candidate.term.at}")
        gain, place = state.score(fit) - state.score(old), look.candidate.term.joint
        if gain > best.get(place, (0.0, None))[0]:
            best[place] = gain, look.candidate
    if len(best) > 1:
        hypothesis = old.hypothesis
        for _, candidate in best.values():
            hypothesis = candidate.added_to(hypothesis)
        fit = _tried(state, next(iter(best.values()))[1], hypothesis, old, everywhere=True)
        new += [] if fit is None else [fit]
    return new


def _here(candidate: Candidate, old: Fit) -> tuple[object, ...]:
    """A candidate and what the fit to which it is added has at its place, since joints hardly interact."""
    term = candidate.term
    beside = (own for own in old.hypothesis.terms if own.joint == term.joint)
    there = sorted((*own.key, own.along, *sorted(own.freed), *own.added) for own in beside)
    return (*term.key, term.run, term.along, *term.added, *there)


def _promising(looks: Sequence[Look]) -> list[Look]:
    """The candidates that are fitted: some of every place, since effects hardly show at other joints."""
    places = {look.candidate.term.joint for look in looks}
    most, counts = max(PER_PLACE, FITTED // max(len(places), 1)), dict.fromkeys(places, 0)
    chosen = []
    for look in _leading(looks):
        place = look.candidate.term.joint
        if look.gain >= PROMISE * ODDS and counts[place] < most:
            counts[place] += 1
            chosen += [other for other in looks if _is_same(other, look) and other.gain >= PROMISE * ODDS]
    return chosen


def _is_same(one: Look, other: Look) -> bool:
    """Whether two candidates are one effect, along whatever signal."""
    own, theirs = one.candidate.term, other.candidate.term
    return (own.key, own.run) == (theirs.key, theirs.run)


def _leading(looks: Sequence[Look]) -> list[Look]:
    """Of every effect at every place, the most promising of the signals that may drive it."""
    best: dict[tuple[object, ...], Look] = {}
    for look in looks:
        best.setdefault((look.candidate.term.key, look.candidate.term.run), look)
    return list(best.values())


def _looks(
    state: Search[Any], old: Fit, instead: Term | None = None, *, named: bool = True
) -> Sequence[Look]:
    """Candidates that may be added to a fit, most promising first; weighed once.

    Args:
        state: the fits made so far.
        old: to which they are added.
        instead: the effect whose place they would take, if only its rivals are wanted.
        named: known effects, or forces without a name.
    """
    which = id(old), named, "" if instead is None else instead.joint
    fit, shares, known = state.looked.get(which, (None, None, ()))
    if fit is not old or shares is not state.shares:
        known = _weighed(state, old, lambda one: _is_named(one) == named and _is_rival(state, one, instead))
        state.looked[which] = old, state.shares, known
    return known


def _weighed(state: Search[Any], old: Fit, wanted: Callable[[Candidate], bool]) -> list[Look]:
    data = state.about(old)
    left = [np.where(data.rows_seen(i)[:, None], residuals(data, old, i), 0.0) for i in range(data.fitted)]
    options = data.candidates(old.hypothesis, old.numbers, left)
    return Screen(data, old, state.shares).best([one for one in options if wanted(one)])


def _is_named(candidate: Candidate) -> bool:
    return not candidate.term.effect.is_unknown


def _is_rival(state: Search[Any], candidate: Candidate, term: Term | None) -> bool:
    """Whether a candidate may explain what a term does; torques of one joint do not show in another."""
    if term is None:
        return True
    is_local = _is_local(state, candidate.term) and _is_local(state, term)
    return candidate.term.at == term.at or not is_local


def _may_be_late(state: Search[Any], delay: str, term: Term) -> bool:
    """Whether a delay may explain what a term does: that of its own joint, if it acts on no other."""
    return delay.split(".")[0] == term.joint or not _is_local(state, term)


def _is_local(state: Search[Any], term: Term) -> bool:
    """Whether a term acts on the torque of its own joint only."""
    return isinstance(term.effect, JointEffect) and term.at in state.data.joints


def _tried(
    state: Search[Any], candidate: Candidate, hypothesis: Hypothesis, old: Fit, *, everywhere: bool = False
) -> Fit | None:
    """The fit, where it has numbers that can be; it differs at the candidate's place only, or everywhere."""
    data = state.data
    try:
        fit = _timed(state, hypothesis, old, None if everywhere else candidate.term.joint)
    except np.linalg.LinAlgError:
        return None
    for key, why in fit.impossible.items():
        is_new = key == candidate.term.key and not candidate.term.is_given
        if is_new and state.gain(fit) > state.score(old):
            state.dismissed.setdefault(key, why)
        return None
    if not np.all(np.isfinite(fit.errors)) or not _is_felt(data, fit, old):
        return None
    if not candidate.term.is_given:
        state.steps.append(Step(candidate.term.key, fit, old))
    return state.keep(fit)


def _is_felt(data: Data, fit: Fit, old: Fit) -> bool:
    """Whether a fit explains more than the error of any model at some joint in some block."""
    removed = (old.errors - fit.errors) / np.maximum(data.counts, 1.0)
    return bool(np.any(removed > data.error**2))


def _pruned(state: Search[Any], best: Fit) -> Fit:
    """The fit without effects whose removal does not lower the score."""
    while best.hypothesis.terms:
        fewer = [_without(state, best, term) for term in best.hypothesis.terms]
        fewer += [_lacking(state, best, term, name) for term in best.hypothesis.terms for name in term.added]
        top = max(fewer, key=state.score)
        if state.score(top) <= state.score(best):
            break
        best = top
    return best


def _without(state: Search[Any], best: Fit, term: Term) -> Fit:
    hypothesis = best.hypothesis.less(term)
    return state.known(
        hypothesis, lambda: state.settled(_fitted(state, hypothesis, best, term.joint), whole=False)
    )


def _lacking(state: Search[Any], best: Fit, term: Term, name: str) -> Fit:
    """The fit without an optional number of a term."""
    terms = tuple(one.lacking(name) if one is term else one for one in best.hypothesis.terms)
    hypothesis = replace(best.hypothesis, terms=terms)
    return state.known(hypothesis, lambda: _fitted(state, hypothesis, best))


def _changing(fit: Fit) -> tuple[Term, ...]:
    """Terms that differ from the robot file."""
    return tuple(term for term in fit.hypothesis.terms if not term.is_given or term.freed)


def _exchanged(state: Search[Any], best: Fit, progress: Said | None) -> Fit:
    """Compare every effect with its best rivals until no exchange improves the score."""
    for _ in range(MOST):
        for term in _changing(best):
            less = _without(state, best, term)
            for name in state.data.delays:  # a delay is a parameter, not a term
                if name in less.hypothesis.filed and _may_be_late(state, name, term):
                    _estimating(state, less, name)
            every = _looks(state, less, term)
            looks = [one for one in _leading(every) if one.candidate.term.key != term.key]
            close = [one for one in looks if one.gain > looks[0].gain - CLOSE]
            same = [one for one in every if _is_along_another(one.candidate.term, term)]
            for look in (*looks[: max(RIVALS, min(len(close), 2 * RIVALS))], *same):
                hypothesis = look.candidate.added_to(less.hypothesis)
                if look.gain >= PROMISE * ODDS and hypothesis.key not in state.made:
                    _tried(state, look.candidate, hypothesis, less)
        if progress:
            progress("comparing effects with their rivals")
        top = state.settled(state.best)
        if top is best:
            break
        best = top
    return best


def _is_along_another(term: Term, than: Term) -> bool:
    """Whether a term is the same effect along another signal."""
    return term.key == than.key and term.along != than.along


def _without_names(state: Search[Any], best: Fit, progress: Said | None) -> Fit:
    """Try unnamed forces in addition to the named effects, and instead of each of them."""
    if progress:
        progress("searching for forces without a name")
    for start in [best, *(_without(state, best, term) for term in _changing(best))]:
        for look in _looks(state, start, named=False)[:RIVALS]:
            hypothesis = look.candidate.added_to(start.hypothesis)
            if look.gain >= PROMISE * ODDS and hypothesis.key not in state.made:
                _tried(state, look.candidate, hypothesis, start)
    return state.best


def _simplified(state: Search[Any], best: Fit) -> Fit:
    """The fit with parameters from the robot file and without delays, where that does not lower the score."""
    data = state.data

    def filed(of: Fit, name: Number) -> Fit:
        if isinstance(name, tuple):  # of a law, of whose parameters the torques are not linear
            hypothesis = of.hypothesis.refiling(*name)
            return state.known(hypothesis, lambda: state.settled(_fitted(state, hypothesis, of)))
        return _refiled(state, of.hypothesis.filing(name), of, name)

    while True:
        held = {name for name, _ in best.hypothesis.held} | best.hypothesis.filed
        names: list[Number] = [name for name in (*filable(data), *data.timing) if name not in held]
        names += best.hypothesis.freed
        alone = {name: state.score(filed(best, name)) - state.score(best) for name in names}
        before = best
        for name in sorted(names, key=lambda n: -alone[n]):
            if alone[name] > -ODDS:
                trial = filed(best, name)
                best = trial if state.score(trial) > state.score(best) else best
        if best is before:
            return best
        best = state.keep(_fitted(state, best.hypothesis, best))


def _freed(state: Search[Any], best: Fit) -> Fit:
    """The fit with parameters estimated again where the robot file's value lowers the score."""
    for name in sorted(best.hypothesis.filed):
        trial = _estimating(state, best, name)
        best = trial if state.score(trial) > state.score(best) else best
    return best


def _estimating(state: Search[Any], fit: Fit, name: str) -> Fit:
    """The fit that estimates one parameter so far taken from the robot file."""
    hypothesis = replace(fit.hypothesis, filed=fit.hypothesis.filed - {name})
    return _refiled(state, hypothesis, fit, name)


def _refiled(state: Search[Any], hypothesis: Hypothesis, start: Fit, name: str) -> Fit:
    """The fit that differs from another in whether one parameter is taken from the robot file."""

    def make() -> Fit:
        made = refiled(state.about(start), hypothesis, start)
        return state.settled(made) if name.endswith(TIMING) else made

    return state.known(hypothesis, make)
