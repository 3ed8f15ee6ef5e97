"""From the standard model to the hypotheses that predict best.

The best few are carried on: every effect at every place is looked at beside each of them, the most promising
ones are fitted, and the best of what was fitted go on to the next round. Then what is not needed goes:
effects, and numbers of the standard model that are as well taken from the robot file; and every effect that
stayed is held against what could be in its place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import (
    BODIES,
    Candidate,
    Hypothesis,
    Term,
    UnknownForce,
    candidates,
    not_credible,
)
from missing_physics.hypotheses.extents import EDGES
from missing_physics.inference.data import TIMING, Data
from missing_physics.inference.fit import Fit, fitted, refiled
from missing_physics.inference.places import places
from missing_physics.inference.score import block_scores, independent_shares
from missing_physics.inference.screening import Look, Screen
from missing_physics.plausibility.table import ENCODER_DELAY, TORQUE_DELAY

__all__ = ["Search", "Step", "filable", "prior", "search"]

Array = NDArray[np.float64]

#: Prior odds against one more effect at one place, and against a number that is not as the robot file has it
#: [nats]: one in fifty, as there are some dozens of each.
ODDS = 4.0
#: Further odds against what happens once [nats]: it could have happened at any other time. One over the
#: number of stretches of time in which it is looked for.
EVENT = float(np.log(0.5 * EDGES**2))
#: Further odds against a force that no known effect is [nats]: as much again.
UNNAMED = 4.0
#: Hypotheses that are carried on, candidates of each that are fitted and of each place at least, rounds at
#: most, and rivals of each effect of the answer that are fitted.
CARRIED, FITTED, PER_PLACE, MOST, RIVALS = 2, 6, 2, 12, 3
#: Rounds at most in which recordings are taken about the best hypothesis and it is looked for again.
SETTLED = 3
#: Rivals that promise as much but for this are fitted too, twice as many at most [nats]: one in twenty is
#: stated.
CLOSE = 3.0
#: A candidate is fitted where it promises this much of what it has to bring.
PROMISE = 0.5
#: A common delay of more samples is none of recording.
CUSTOMARY = 2.0
#: Numbers of a joint that a robot file has.
OF_JOINTS = ("viscous", "coulomb", "offset", "reflected_inertia", TIMING)

Said = Callable[[str], None]


@dataclass(frozen=True)
class Step:
    """One hypothesis that was fitted in the search.

    Attributes:
        key: effect and place that were added, exchanged or left out.
        fit: with it.
        before: what it was added to, or taken from.
    """

    key: tuple[str, str]
    fit: Fit
    before: Fit


@dataclass
class Search:
    """What was fitted.

    Attributes:
        data: the rows.
        standard: the fit of the standard model.
        made: all credible hypotheses that were fitted, by key.
        shares: independent samples over samples at each joint, of what the best one leaves.
        steps: how effects were tried, in order.
        dismissed: effects that fit and cannot be, with the reason.
    """

    data: Data
    standard: Fit
    made: dict[tuple[object, ...], Fit]
    shares: Array
    steps: list[Step] = field(default_factory=list)
    dismissed: dict[tuple[str, str], str] = field(default_factory=dict)

    @property
    def fits(self) -> tuple[Fit, ...]:
        """All, best first."""
        return tuple(sorted(self.made.values(), key=self.score, reverse=True))

    @property
    def best(self) -> Fit:
        """The one with the best score."""
        return max(self.made.values(), key=self.score)

    def score(self, fit: Fit) -> float:
        """Log score of a fit with the prior of its effects and numbers [nats]."""
        return float(block_scores(self.data, fit, self.shares).sum()) + prior(self.data, fit.hypothesis)

    def keep(self, fit: Fit) -> Fit:
        """Remember a fit."""
        self.made[fit.hypothesis.key] = fit
        return fit


def filable(data: Data) -> tuple[str, ...]:
    """Numbers of the standard model that may be as the robot file has them."""
    layout = data.layout
    own = tuple(
        name
        for name, free in zip(layout.names, layout.free)
        if free and name.rpartition(".")[2] in OF_JOINTS and name.split(".")[0] in data.joints
    )
    bodies = any(layout.free[place].any() for place in layout.bodies)
    return (*own, BODIES) if bodies else own


def prior(data: Data, hypothesis: Hypothesis) -> float:
    """Logarithm of the prior probability beside that of the robot file [nats]."""
    effects = sum(
        ODDS + EVENT * term.effect.is_event + UNNAMED * isinstance(term.effect, UnknownForce)
        for term in hypothesis.terms
    )
    given = hypothesis.filed | {name for name, _ in hypothesis.held}
    for term in hypothesis.terms:
        if isinstance(term.effect, UnknownForce):
            given |= {f"{term.at}.{name}" for name in term.effect.along}
        known = f"{term.at}.coulomb" in data.layout.names
        if known and term.effect.family and data.filed[data.layout.names.index(f"{term.at}.coulomb")] == 0.0:
            given -= {f"{term.at}.coulomb"}  # a law has kinetic friction in it, which the file lacks
    return -effects - ODDS * sum(name not in given for name in filable(data))


def search(data: Data, progress: Said | None = None) -> Search:
    """Look for what the recordings show beyond the robot file."""
    standard = fitted(data, Hypothesis())
    state = _begun(data.about((), standard.numbers))
    best = _grown_up(state, list(state.made.values()), progress)
    for _ in range(SETTLED):  # what friction does at rest follows from what else is there
        about = best.hypothesis
        state = _begun(data.about(about.terms, best.numbers))
        state.keep(fitted(state.data, about, best))
        best = _pruned(state, _grown_up(state, list(state.made.values()), progress))
        if {t.key for t in best.hypothesis.terms} == {t.key for t in about.terms}:
            break
    best = _simplified(state, _freed(state, best))
    best = _exchanged(state, best, progress)
    best = _without_names(state, _freed(state, best), progress)
    _freed(state, best)
    state.shares = independent_shares(data, state.best)
    return state


def _begun(data: Data) -> Search:
    """With the standard model, and with it as far as it is not in the robot file."""
    standard = _timed(data, Hypothesis())
    state = Search(data, standard, {}, independent_shares(data, standard))
    state.keep(standard)
    nominal = state.keep(fitted(data, Hypothesis().filing(*filable(data))))
    plain = _simplified(state, max([standard, nominal], key=state.score))
    state.made = {fit.hypothesis.key: fit for fit in (standard, nominal, plain)}
    return state


def _timed(data: Data, hypothesis: Hypothesis, start: Fit | None = None) -> Fit:
    """The fit; one without delays where these come out as no recording's are."""
    fit = fitted(data, hypothesis, start)
    common, step = fit.number(TIMING), 1.0 / data.runs[0].motion.rate
    own = [common + fit.number(f"{joint}.{TIMING}") for joint in data.joints]
    late = min(own) >= -ENCODER_DELAY and max(own) <= TORQUE_DELAY
    if late and abs(common) <= CUSTOMARY * step:
        return fit
    names = (TIMING, *(f"{joint}.{TIMING}" for joint in data.joints))
    return fitted(data, hypothesis.filing(*names), start)


def _grown_up(state: Search, carried: Sequence[Fit], progress: Said | None) -> Fit:
    """The best that grows of some fits, effect by effect."""
    for _ in range(MOST):
        before = max(map(state.score, carried))
        new = [fit for old in carried for fit in _grown(state, old, progress)]
        best = sorted([*carried, *new], key=state.score, reverse=True)[:CARRIED]
        if not new or state.score(best[0]) <= before:
            break
        carried, state.shares = best, independent_shares(state.data, best[0])
    return max(carried, key=state.score)


def _grown(state: Search, old: Fit, progress: Said | None) -> list[Fit]:
    """Credible fits with more that were not made before: one effect, and then the best of every place."""
    new: list[Fit] = []
    best: dict[str, tuple[float, Candidate]] = {}
    for look in _promising(_named(_looks(state, old))):
        hypothesis = look.candidate.added_to(old.hypothesis)
        if hypothesis.key in state.made:
            continue
        fit = _tried(state, look.candidate, hypothesis, old)
        if fit is None:
            continue
        new.append(fit)
        if progress:
            progress(f"{look.candidate.term.effect.title} at {look.candidate.term.at}")
        gain, place = state.score(fit) - state.score(old), _place(look.candidate.term)
        if gain > best.get(place, (0.0, None))[0]:
            best[place] = gain, look.candidate
    if len(best) > 1:
        hypothesis = old.hypothesis
        for _, candidate in best.values():
            hypothesis = candidate.added_to(hypothesis)
        fit = _tried(state, next(iter(best.values()))[1], hypothesis, old)
        new += [] if fit is None else [fit]
    return new


def _place(term: Term) -> str:
    """Joint or body of a term."""
    return term.at.split(".")[0]


def _promising(looks: Sequence[Look]) -> list[Look]:
    """The looks that are fitted: some of every place, since what acts at one joint hardly tells of others."""
    places = {_place(look.candidate.term) for look in looks}
    most, counts = max(PER_PLACE, FITTED // max(len(places), 1)), dict.fromkeys(places, 0)
    chosen = []
    for look in looks:
        place = _place(look.candidate.term)
        if look.gain >= PROMISE * ODDS and counts[place] < most:
            counts[place] += 1
            chosen.append(look)
    return chosen


def _looks(state: Search, old: Fit) -> list[Look]:
    """All candidates beside a fit, most promising first."""
    data = state.data
    channels = frozenset.intersection(*(run.channels for run in data.runs))
    if not all(run.is_rigid_and_fixed for run in data.runs):
        # what an encoder's error costs is not linearised
        channels = frozenset(c for c in channels if c.endswith(".torque"))
    options = list(candidates(data.standard.nominal, old.hypothesis, places(data, old), channels))
    return Screen(data, old, state.shares).best(options)


def _tried(state: Search, candidate: Candidate, hypothesis: Hypothesis, old: Fit) -> Fit | None:
    """The fit, where it has numbers that can be."""
    data = state.data
    try:
        fit = _timed(data, hypothesis, old)
    except np.linalg.LinAlgError:
        return None
    for term in fit.hypothesis.terms:
        joint = term.at.split(".")[0]
        needed = 0.0
        if joint in data.joints:
            needed = max(float(np.abs(run.needed[:, data.joints.index(joint)]).max()) for run in data.runs)
        why = not_credible(term, data.standard.nominal, needed)
        if why:
            if term.key == candidate.term.key and state.score(fit) > state.score(old):
                state.dismissed.setdefault(term.key, why)
            return None
    if not np.all(np.isfinite(fit.errors)):
        return None
    state.steps.append(Step(candidate.term.key, fit, old))
    return state.keep(fit)


def _pruned(state: Search, best: Fit) -> Fit:
    """Less every effect without which the rest does as well."""
    while best.hypothesis.terms:
        fewer = [_without(state, best, term) for term in best.hypothesis.terms]
        top = max(fewer, key=state.score)
        if state.score(top) <= state.score(best):
            break
        best = top
    return best


def _without(state: Search, best: Fit, term: Term) -> Fit:
    hypothesis = best.hypothesis.without(term)
    if hypothesis.key not in state.made:
        fit = fitted(state.data, hypothesis, best)
        if term.effect.family:  # without a law of friction the recordings are taken about that
            own = state.data.about(fit.hypothesis.terms, fit.numbers)
            fit = max([fit, fitted(own, fit.hypothesis, fit)], key=state.score)
        state.keep(fit)
    return state.made[hypothesis.key]


def _exchanged(state: Search, best: Fit, progress: Said | None) -> Fit:
    """Every effect against the best of what could be in its place, until nothing is better."""
    for _ in range(MOST):
        for term in best.hypothesis.terms:
            less = _without(state, best, term)
            for joint in state.data.joints:  # a delay is a number and no term
                if f"{joint}.{TIMING}" in less.hypothesis.filed:
                    _estimating(state, less, f"{joint}.{TIMING}")
            looks = [one for one in _named(_looks(state, less)) if one.candidate.term.key != term.key]
            close = [one for one in looks if one.gain > looks[0].gain - CLOSE]
            for look in looks[: max(RIVALS, min(len(close), 2 * RIVALS))]:
                hypothesis = look.candidate.added_to(less.hypothesis)
                if look.gain >= PROMISE * ODDS and hypothesis.key not in state.made:
                    _tried(state, look.candidate, hypothesis, less)
        if progress:
            progress("holding effects against each other")
        top = state.best
        if top is best:
            break
        best = top
    return best


def _without_names(state: Search, best: Fit, progress: Said | None) -> Fit:
    """Forces without a name beside the named ones, and in the place of each."""
    if progress:
        progress("looking for physics without a name")
    for start in [best, *(_without(state, best, term) for term in best.hypothesis.terms)]:
        for look in [one for one in _looks(state, start) if _is_unnamed(one)][:RIVALS]:
            hypothesis = look.candidate.added_to(start.hypothesis)
            if look.gain >= PROMISE * ODDS and hypothesis.key not in state.made:
                _tried(state, look.candidate, hypothesis, start)
    return state.best


def _is_unnamed(look: Look) -> bool:
    return isinstance(look.candidate.term.effect, UnknownForce)


def _named(looks: Sequence[Look]) -> list[Look]:
    return [look for look in looks if not _is_unnamed(look)]


def _simplified(state: Search, best: Fit) -> Fit:
    """With every number from the robot file that is as well taken from there."""
    data = state.data

    def filed(of: Fit, name: str) -> Fit:
        hypothesis = of.hypothesis.filing(name)
        if hypothesis.key not in state.made:
            state.keep(refiled(data, hypothesis, of))
        return state.made[hypothesis.key]

    while True:
        held = {name for name, _ in best.hypothesis.held} | best.hypothesis.filed
        names = [name for name in filable(data) if name not in held]
        alone = {name: state.score(filed(best, name)) - state.score(best) for name in names}
        before = best
        for name in sorted(names, key=lambda n: -alone[n]):
            if alone[name] > -ODDS:
                trial = filed(best, name)
                best = trial if state.score(trial) > state.score(best) else best
        if best is before:
            return best
        best = state.keep(fitted(data, best.hypothesis, best))


def _freed(state: Search, best: Fit) -> Fit:
    """With every number estimated again that is not as the robot file has it beside the rest."""
    for name in sorted(best.hypothesis.filed):
        trial = _estimating(state, best, name)
        best = trial if state.score(trial) > state.score(best) else best
    return best


def _estimating(state: Search, fit: Fit, name: str) -> Fit:
    """With one number estimated that is from the robot file."""
    hypothesis = replace(fit.hypothesis, filed=fit.hypothesis.filed - {name})
    if hypothesis.key not in state.made:
        state.keep(refiled(state.data, hypothesis, fit))
    return state.made[hypothesis.key]
