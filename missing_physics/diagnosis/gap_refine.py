"""The exact law of a hysteresis in a gear, where a search along Dahl's has named one."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from missing_physics.diagnosis.gap_causes import Cause, hysteresis_of
from missing_physics.diagnosis.gap_search import GapData, GapFit, fit_gap

__all__ = ["with_exact_hysteresis"]

#: The travel is looked for within this factor of the one that the search chose, both ways.
FACTOR = 10.0
#: Rounds of travel and height in turn, and tolerance of the logarithm of the travel.
ROUNDS = 3
TOLERANCE = 1e-3


def with_exact_hysteresis(data: GapData, fit: GapFit) -> GapFit:
    """`fit` with friction inside the gear by its own law, its travel fitted; unchanged without such a cause.

    The law needs the height T_h beside K times the travel; it is that of the last fit.
    """
    own = next((cause for cause in fit.causes if cause.torque is not None), None)
    spring = fit.compliance
    if own is None or own.torque is None or spring is None or spring[1] <= 0:
        return fit
    name, (_, size, unit), torque = own.torque, own.known[0], own.meanings[0].unit

    def cause(size: float, height: float, slope: float = 0.0) -> Cause:
        return hysteresis_of(own.location, name, size, torque, unit, height=height, slope=slope)

    def fitted(exact: Cause) -> GapFit:
        return fit_gap(data, [exact if c.key == own.key else c for c in fit.causes])

    best = fit
    for _ in range(ROUNDS):
        height = _height(best, own)
        found = minimize_scalar(
            lambda x, h=height: _error(fitted(cause(float(np.exp(x)), h))),
            bounds=(np.log(size / FACTOR), np.log(size * FACTOR)),
            method="bounded",
            options={"xatol": TOLERANCE},
        )
        size = float(np.exp(found.x))
        best = fitted(cause(size, height))
    exact = fitted(cause(size, _height(best, own), _amplitude(best, own)))
    return exact if exact.admissible else fit


def _amplitude(fit: GapFit, own: Cause) -> float:
    """T_h / K [rad or m]."""
    named = next(cause for cause in fit.causes if cause.key == own.key)
    return max(float(fit.coefficients[fit.slice_of(named)][0]), 0.0)


def _height(fit: GapFit, own: Cause) -> float:
    """T_h [N m or N]."""
    spring = fit.compliance
    assert spring is not None
    return _amplitude(fit, own) / spring[1] if spring[1] > 0 else 0.0


def _error(fit: GapFit) -> float:
    return float((fit.residual[fit.data.fitted] ** 2).sum())
