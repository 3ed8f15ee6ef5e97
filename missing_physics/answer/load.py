"""The answer with a load on a link, or with links that have wrong mass properties."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from missing_physics.answer.bodies import LOAD, Load, is_real, loads, without_bodies
from missing_physics.answer.findings import STATED
from missing_physics.answer.guard import Guarded, guarded
from missing_physics.hypotheses import BODIES, Term, not_credible
from missing_physics.inference import Fit
from missing_physics.inference.fit import fitted
from missing_physics.inference.ledger import Search
from missing_physics.inference.score import block_scores
from missing_physics.inference.torques.data import TorqueData
from reference_model.effects.catalogue import get_effect

__all__ = ["Carried", "carried"]


#: A load is named if its hypothesis predicts at most this much worse than the one with all bodies estimated
#: [nats]: odds of one in twenty.
AS_WELL = 3.0


@dataclass(frozen=True)
class Carried:
    """Explanation of estimated bodies that differ from the robot file.

    Attributes:
        loads: the explanations, most probable first.
        fit: with the load if a load is the most probable explanation, else with all bodies estimated.
        safe: the guarded fit with a load; None if the standard model predicts a joint better.
    """

    loads: tuple[Load, ...]
    fit: Fit
    safe: Guarded | None = None


def carried(found: Search[TorqueData], best: Fit, safe: Fit) -> Carried | None:
    """The load or the wrong bodies, if credible and more probable than a generally inaccurate file.

    Args:
        found: the search.
        best: the most probable hypothesis.
        safe: the guarded fit.
    """
    explained, data = loads(found.data, best, found.shares), found.data
    named = [load for load in explained if load.effect]
    if not named or sum(load.probability for load in named) <= STATED:
        return None
    top = named[0]
    if top.effect != LOAD:
        return Carried(explained, safe) if all(is_real(data, safe, body) for body in top.bodies) else None
    term = Term.of(get_effect(top.effect), top.bodies[0], top.values)
    hypothesis = without_bodies(data, best.hypothesis).taking_from_file(BODIES)
    hypothesis = replace(hypothesis, terms=(*hypothesis.terms, term), accuracy=top.accuracy)
    try:
        fit = _without_compensation(found, found.settled(fitted(data, hypothesis, best)), term)
    except np.linalg.LinAlgError:
        return None
    if any(not_credible(t, data.standard.nominal, 0.0) for t in fit.hypothesis.terms if t.key == term.key):
        return None
    predicted = [float(block_scores(data, one, found.shares).sum()) for one in (fit, best)]
    if predicted[0] < predicted[1] - AS_WELL:
        return None
    guard = guarded(data, fit, found.standard)
    return Carried(explained, fit, guard if guard.fit is fit else None)


def _without_compensation(found: Search[TorqueData], fit: Fit, load: Term) -> Fit:
    """The fit without effects that only compensated for the load and do not improve the score."""
    while True:
        others = [t for t in fit.hypothesis.terms if t.key != load.key and (t.freed or not t.is_given)]
        fewer = [found.settled(fitted(found.data, fit.hypothesis.less(t), fit)) for t in others]
        best = max(fewer, key=found.score, default=None)
        if best is None or found.score(best) < found.score(fit):
            return fit
        fit = best
