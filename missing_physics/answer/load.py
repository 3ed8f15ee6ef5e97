"""The answer with a load on a link, or with links whose mass properties are wrong."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from missing_physics.answer.bodies import Load, loads, without_bodies
from missing_physics.answer.findings import STATED
from missing_physics.answer.guard import Guarded, guarded
from missing_physics.hypotheses import BODIES, Term
from missing_physics.inference import Fit
from missing_physics.inference.fit import fitted
from missing_physics.inference.ledger import Search
from reference_model.effects.catalogue import get_effect

__all__ = ["Carried", "carried"]


@dataclass(frozen=True)
class Carried:
    """What bodies off the robot file's are due to.

    Attributes:
        loads: the explanations.
        fit: the most probable hypothesis with the most probable of them.
        safe: the same as the answer, None where the standard model predicts a joint better.
    """

    loads: tuple[Load, ...]
    fit: Fit
    safe: Guarded | None


def carried(found: Search, best: Fit) -> Carried | None:
    """The load or the wrong bodies, if more probable than a file that is off as a whole.

    Args:
        found: the search.
        best: the most probable hypothesis.
    """
    explained = loads(found.data, best, found.shares)
    named = [load for load in explained if load.effect]
    if not named or sum(load.probability for load in named) <= STATED:
        return None
    top = named[0]
    hypothesis = without_bodies(best.hypothesis).filing(BODIES)
    terms = tuple(Term.of(get_effect(top.effect), body, top.values) for body in top.bodies)
    hypothesis = replace(hypothesis, terms=(*hypothesis.terms, *terms), accuracy=top.accuracy)
    try:
        fit = found.settled(fitted(found.data, hypothesis, best))
    except np.linalg.LinAlgError:
        return None
    safe = guarded(found.data, fit, found.standard)
    return Carried(explained, fit, safe if safe.fit is fit else None)
