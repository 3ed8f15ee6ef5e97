"""Laws of dry friction compared on rows that include quick reversals.

Laws such as Stribeck's and LuGre's differ from Coulomb's at slow speeds, next to reversals, where the rows of
a search have little weight. On rows in which only the unknown part of the friction at reversals is removed
(`missing_physics.evaluation.nuisance`) hypotheses are fitted anew that differ in friction only, and
`missing_physics.inference.posterior.weighed` takes their relative scores from these fits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from missing_physics.hypotheses import Candidate, Term
from missing_physics.inference.fit import Fit, fitted, residuals
from missing_physics.inference.ledger import Search
from missing_physics.inference.posterior import Posterior, apart_from_friction
from missing_physics.inference.score import independent_shares
from missing_physics.inference.screening import Screen
from missing_physics.inference.search import leading, try_candidate
from missing_physics.inference.torques.data import TorqueData

__all__ = ["searched_at_reversals"]

#: Least probability of a hypothesis that is fitted anew [-]; less does not change a hundredth.
LIKELY = 2e-3
#: Laws whose score is this much below the best one are not added to the search [nats]: the same probability.
FAR = 6.0


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
    progress("comparing laws of friction near reversals")
    state = _begun(rows(), found, known.answer)
    best = _with_best_laws(state, state.best)
    for fit in [fit for fit in state.fits if state.score(fit) > state.score(best) - FAR]:
        if fit.hypothesis.key not in found.made:
            _refitted(found, fit)
    likely = [fit for fit, weight in zip(known.fits, known.weights) if weight > LIKELY]
    groups = [apart_from_friction(found.data, fit) for fit in [*likely, *state.fits]]
    for fit, group in zip(likely, groups):
        if groups.count(group) > 1 and fit.hypothesis.key not in state.made:
            _refitted(state, fit)
    return state


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
