"""Loads and wrong mass properties of links as each other."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from missing_physics.diagnosis.terms.term import BODY_NUMBERS, Term, body_terms
from reference_model.effects.catalogue import get_effect

__all__ = ["as_wrong", "nearest_point"]

Array = NDArray[np.float64]


def as_wrong(term: Term) -> Term:
    """A load, or wrong mass properties, as changes of the ten numbers of its link."""
    wrong = get_effect("inertia")
    names = (p.name for p in wrong.parameters)
    return Term(wrong, term.at, dict(zip(names, map(float, body_terms(term)[0]))))


def nearest_point(term: Term, spreads: Mapping[str, float], start: Term) -> Term:
    """The load whose mass properties come closest to those that are told."""
    names = [number.replace(".", "_") for number in BODY_NUMBERS]
    told = [names.index(name) for name in term.free if np.isfinite(spreads.get(name, np.inf))]
    wanted = np.array([term.parameters[names[k]] for k in told])
    weight = 1.0 / np.maximum([spreads[names[k]] for k in told], 1e-9 * np.abs(wanted) + 1e-300)
    mass = term.parameters["mass"] if "mass" in term.free else float(np.sign(wanted.sum()))

    def left(values: Array) -> Array:
        return np.asarray((body_terms(start.at_values(values))[0][told] - wanted) * weight)

    first = np.array([mass or 1.0, *(start.parameters[axis] for axis in "xyz")])
    found = least_squares(left, first, bounds=start.bounds, x_scale=np.maximum(np.abs(first), 0.1))
    return start.at_values(found.x)
