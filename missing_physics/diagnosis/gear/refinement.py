"""Causes by their exact laws, where a search along simpler columns has named them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from missing_physics.diagnosis.gear.causes import Cause, cubic_spring, exact_delay, hysteresis_of
from missing_physics.diagnosis.gear.cycles import with_exact_cycle
from missing_physics.diagnosis.gear.fit import GapData, GapFit, fit_gap

__all__ = ["with_exact_hysteresis", "with_exact_shapes"]

#: What is fitted is looked for within this factor of what the search chose, both ways.
FACTOR = 10.0
#: Rounds of travel and height in turn, and tolerance of the logarithm of the travel.
ROUNDS = 3
TOLERANCE = 1e-2


def with_exact_shapes(data: GapData, fit: GapFit) -> GapFit:
    """`fit` with its delay linearised about itself, its cycle's order fitted beside all the rest, and a
    hardening spring inverted without truncation."""
    return _with_exact_spring(data, with_exact_cycle(data, _with_exact_delay(data, fit)))


def _with_exact_delay(data: GapData, fit: GapFit) -> GapFit:
    """`fit` with its delay linearised about itself instead of about zero."""
    for _ in range(2):
        for cause in fit.causes:
            if cause.effect == "sensor_delay":
                around = float(fit.coefficients[fit.slice_of(cause)][0])
                exact = exact_delay(cause.location, around)
                fit = fit_gap(data, [exact if c.key == cause.key else c for c in fit.causes])
                break
    return fit


def _with_exact_spring(data: GapData, fit: GapFit) -> GapFit:
    own = next((c for c in fit.causes if _is_cubic(c)), None)
    if own is None or not fit.admissible:
        return fit
    start = own.known[0][1] if own.known else _hardening(fit, own)

    def fitted(hardening: float, slope: float = 0.0) -> GapFit:
        exact = cubic_spring(own, hardening, slope=slope)
        return fit_gap(data, [exact if c.key == own.key else c for c in fit.causes])

    found = minimize_scalar(
        lambda x: _error(fitted(float(np.exp(x)))),
        bounds=(np.log(start / FACTOR), np.log(start * FACTOR)),
        method="bounded",
        options={"xatol": TOLERANCE},
    )
    hardening = float(np.exp(found.x))
    spring = fitted(hardening).compliance
    exact = fitted(hardening, spring[1]) if spring is not None and spring[1] > 0 else fit
    return exact if exact.admissible and _error(exact) <= _error(fit) else fit


def _is_cubic(cause: Cause) -> bool:
    named = [*(meaning.name for meaning in cause.meanings), *(name for name, *_ in cause.known)]
    return cause.torque is not None and "cubic_stiffness" in named


def _hardening(fit: GapFit, own: Cause) -> float:
    """K3/K^3 of the truncated law, e = T/K - (K3/K^4) T^3."""
    named = dict(zip([m.name for m in own.meanings], fit.coefficients[fit.slice_of(own)]))
    return float(-named["cubic_stiffness"] / named["stiffness"])


def with_exact_hysteresis(data: GapData, fit: GapFit, causes: Sequence[Cause]) -> GapFit:
    """`fit` with friction inside the gear by its own law, its travel fitted; unchanged without such a cause.

    Spring and friction of one gear carry one torque, so they are fitted along the same estimate of it: the
    one that leaves the least. `causes` are all shapes.
    """
    own = next((c for c in fit.causes if c.torque is not None and c.effect == "gear_hysteresis"), None)
    spring = next((c for c in fit.causes if c.effect == "joint_elasticity"), None)
    if own is None or spring is None or spring.known:
        return fit
    names = [meaning.name for meaning in spring.meanings]
    tried = [
        _hysteresis_along(data, fit, spring=other, own=own)
        for other in causes
        if other.key == spring.key and [meaning.name for meaning in other.meanings] == names
    ]
    return min((one for one in tried if one is not None), key=_error, default=fit)


def _hysteresis_along(data: GapData, fit: GapFit, *, spring: Cause, own: Cause) -> GapFit | None:
    """With the torque of `spring`. The law needs the height T_h beside K times the travel: the last fit's."""
    (_, size, unit), torque, name = own.known[0], own.meanings[0].unit, spring.torque
    assert name is not None

    def fitted(size: float, height: float, slope: float = 0.0) -> GapFit:
        exact = hysteresis_of(own.location, name, size, torque, unit, height=height, slope=slope)
        other = {own.key: exact, spring.key: spring}
        return fit_gap(data, [other.get(c.key, c) for c in fit.causes])

    best = fitted(size, 0.0)
    for _ in range(ROUNDS):
        height = _height(best, own)
        found = minimize_scalar(
            lambda x, h=height: _error(fitted(float(np.exp(x)), h)),
            bounds=(np.log(size / FACTOR), np.log(size * FACTOR)),
            method="bounded",
            options={"xatol": TOLERANCE},
        )
        size = float(np.exp(found.x))
        best = fitted(size, height)
    exact = fitted(size, _height(best, own), _amplitude(best, own))
    return exact if exact.admissible else None


def _amplitude(fit: GapFit, own: Cause) -> float:
    """T_h / K [rad or m]."""
    named = next(cause for cause in fit.causes if cause.key == own.key)
    return max(float(fit.coefficients[fit.slice_of(named)][0]), 0.0)


def _height(fit: GapFit, own: Cause) -> float:
    """T_h [N m or N]."""
    spring = fit.compliance
    return _amplitude(fit, own) / spring[1] if spring is not None and spring[1] > 0 else 0.0


def _error(fit: GapFit) -> float:
    return float((fit.residual[fit.data.fitted] ** 2).sum())
