"""Dry friction laws compared on rows that include quick reversals.

Laws such as Stribeck's and LuGre's differ from Coulomb's at slow speeds, next to reversals, where the rows of
a search have little weight. On rows in which only the unknown part of the friction at reversals is removed
(`missing_physics.evaluation.nuisance`) hypotheses are fitted anew that differ in friction only, and
`missing_physics.inference.posterior.weighed` takes their relative scores from these fits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from missing_physics.hypotheses import Candidate, Hypothesis, Term
from missing_physics.inference.fit import Fit, fitted, residuals, with_other_file_parameters
from missing_physics.inference.ledger import Search
from missing_physics.inference.posterior import Posterior, apart_from_friction
from missing_physics.inference.score import independent_shares
from missing_physics.inference.screening import Screen
from missing_physics.inference.search import leading, try_candidate
from missing_physics.inference.torques.data import TorqueData

__all__ = ["searched_at_reversals"]

#: Least probability of a hypothesis that is fitted anew [-]: probabilities are stated to a hundredth.
LIKELY = 1e-2
#: Laws whose score is this much below the best one are not added to the search [nats]: odds of a quarter of
#: `LIKELY`, as the rows of the search may favour them. Both only limit the work.
FAR = 6.0
#: Name of no place, so that no nonlinear parameter is fitted again: the other rows determine them better.
NOWHERE = ""


def searched_at_reversals(
    found: Search[TorqueData],
    known: Posterior,
    rows: Callable[[], TorqueData],
    progress: Callable[[str], None],
) -> Search[TorqueData] | None:
    """Fits of likely hypotheses and other laws of dry friction to rows that include quick reversals.

    Laws that are likely there are also fitted to the rows of the search, and added to it.

    Args:
        found: the search.
        known: its posterior.
        rows: makes the rows that include reversals.
        progress: called with a phrase when laws are compared.

    Returns:
        The fits, or None where no joint with dry friction reverses quickly.
    """
    if not _dry(found.data, known.answer):
        return None
    progress("comparing friction laws near reversals")
    state = _begun(rows(), found, known.answer)
    best = _with_best_laws(state, state.best)
    for fit in [fit for fit in state.fits if state.score(fit) > state.score(best) - FAR]:
        _add_to(found, fit, known.answer)
    likely = [fit for fit, weight in zip(known.fits, known.weights) if weight > LIKELY]
    if _terms(best.hypothesis) != _terms(known.answer.hypothesis):
        for fit in likely:  # these laws with other parameters from the file
            hypothesis = _with_laws_of(best.hypothesis, fit.hypothesis)
            if hypothesis is not None:
                _with_parameters(state, hypothesis, best)
                _with_parameters(found, hypothesis, found.made[best.hypothesis.key])
    _compare(state, likely, state.made[known.answer.hypothesis.key])
    return state


def _compare(state: Search[TorqueData], likely: Sequence[Fit], answer: Fit) -> None:
    """Fit those of the likely hypotheses that differ from others in friction only."""
    groups = [apart_from_friction(state.data, fit) for fit in likely]
    compared = {apart_from_friction(state.data, fit) for fit in state.fits}
    for fit, group in zip(likely, groups):
        if group not in compared and groups.count(group) < 2:
            continue
        if _terms(fit.hypothesis) == _terms(answer.hypothesis):
            _with_parameters(state, fit.hypothesis, answer)
        elif fit.hypothesis.key not in state.made:
            _refitted(state, fit)


def _add_to(found: Search[TorqueData], fit: Fit, answer: Fit) -> None:
    """Add a fit to rows that include reversals to the search, fitted to the rows of the search.

    Its rows may hardly determine the law, so nonlinear parameters keep their estimates; only in the answer of
    the search are all fitted again from there.
    """
    key = fit.hypothesis.key
    if key == answer.hypothesis.key:
        _keep_better(found, fitted(found.about(fit), fit.hypothesis, fit))
    elif key not in found.made or any(term.effect.family for term in fit.hypothesis.terms):
        found.settled(fitted(found.about(fit), fit.hypothesis, fit, NOWHERE), whole=False)


def _terms(hypothesis: Hypothesis) -> object:
    """Key of the effects of a hypothesis."""
    return hypothesis.key[0]


def _with_laws_of(best: Hypothesis, other: Hypothesis) -> Hypothesis | None:
    """The second hypothesis with the laws of dry friction of the first; None if it has other effects."""
    own = [tuple(term for term in one.terms if not term.effect.family) for one in (best, other)]
    same = _terms(replace(best, terms=own[0])) == _terms(replace(best, terms=own[1]))
    return replace(best, from_file=other.from_file, accuracy=other.accuracy) if same else None


def _with_parameters(state: Search[TorqueData], hypothesis: Hypothesis, start: Fit) -> None:
    """Fit a hypothesis with the terms of a fit, but other parameters from the robot file."""
    _keep_better(state, with_other_file_parameters(state.about(start), hypothesis, start))


def _keep_better(state: Search[TorqueData], fit: Fit) -> None:
    """Store a fit once it has settled, unless the one of the same hypothesis that is stored is better."""
    before = state.made.get(fit.hypothesis.key)
    made = state.settled(fit, whole=False)
    if before is not None and state.score(before) > state.score(made):
        state.keep(before)


def _dry(data: TorqueData, fit: Fit) -> list[str]:
    """Joints with quick reversals and dry friction in a fit."""
    found = []
    for k, joint in enumerate(data.joints):
        law = any(term.at == joint and term.effect.family for term in fit.hypothesis.terms)
        reverses = any(run.motion.parts[k][1] for run in data.runs)
        if reverses and (law or fit.parameter(f"{joint}.coulomb") > data.error[k]):
            found.append(joint)
    return found


def _begun(data: TorqueData, found: Search[TorqueData], answer: Fit) -> Search[TorqueData]:
    """A search on these rows that holds the answer of another one."""
    data.scans.append(())  # structures that yield are compared on the rows of the other search
    standard = fitted(data, found.standard.hypothesis, found.standard)
    state = Search(data, standard, {}, found.shares)
    fit = _refitted(state, answer)
    state.shares = independent_shares(state.about(fit), fit)
    return state


def _refitted(state: Search[TorqueData], fit: Fit) -> Fit:
    return state.settled(fitted(state.about(fit), fit.hypothesis, fit))


def _with_best_laws(state: Search[TorqueData], best: Fit) -> Fit:
    """The best fit after trying every law of dry friction at one joint after another."""
    while True:
        for joint in _dry(state.data, best):
            _try_laws(state, best, joint)
        if state.best is best:
            return best
        best = state.settled(state.best)


def _try_laws(state: Search[TorqueData], best: Fit, joint: str) -> None:
    """Fit the other laws of dry friction at a joint."""
    hypothesis = best.hypothesis
    for term in hypothesis.terms:
        hypothesis = hypothesis.without(term) if _is_dry(term, joint) else hypothesis
    plain = state.made.get(hypothesis.key) or state.settled(
        fitted(state.about(best), hypothesis, best, joint), whole=False
    )
    for candidate in _laws(state, plain, joint):
        hypothesis = candidate.added_to(plain.hypothesis)
        if hypothesis.key not in state.made:
            try_candidate(state, candidate, hypothesis, plain)


def _laws(state: Search[TorqueData], plain: Fit, joint: str) -> Iterator[Candidate]:
    """Candidates for the law of dry friction at a joint, each with the most promising starting values."""
    data = state.about(plain)
    residual = [
        np.where(data.fitted_rows(i)[:, None], residuals(data, plain, i), 0.0) for i in range(data.fitted)
    ]
    options = data.candidates(plain.hypothesis, plain.parameters, residual)
    laws = [one for one in options if _is_dry(one.term, joint)]
    for screened in leading(Screen(data, plain, state.shares).best(laws)):
        yield screened.candidate


def _is_dry(term: Term, joint: str) -> bool:
    return term.at == joint and term.effect.family is not None
