"""The answer with a load on a link, or with links whose mass properties are wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from missing_physics.answer.findings import STATED
from missing_physics.answer.guard import Guarded, guarded
from missing_physics.hypotheses import BODIES, Term
from missing_physics.inference import Fit
from missing_physics.inference.fit import fitted
from missing_physics.inference.ledger import Search
from missing_physics.inference.loads import Load, without_bodies
from reference_model.effects.catalogue import get_effect

__all__ = ["with_load"]


def with_load(found: Search, best: Fit, carried: Sequence[Load]) -> Guarded | None:
    """The answer with the load or the wrong bodies that are more probable than none.

    None where none are, and where the standard model predicts a joint better.
    """
    named = [load for load in carried if load.effect]
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
    return safe if safe.fit is fit else None
