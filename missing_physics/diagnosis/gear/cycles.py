"""Encoder errors that repeat over the joint's way with an order that nobody knows beforehand.

A disc off centre errs once per turn of its shaft, an oval one twice; but the shaft may run behind a gear, a
scale or a belt of any ratio. So besides these orders (`gear/causes.py`) any order is tried: a periodogram of
what a fit leaves, over the position instead of time and beside everything that is fitted already, gives
starts, and least squares the order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from missing_physics.diagnosis.gear.causes import Cause, Meaning
from missing_physics.diagnosis.gear.fit import GapData, GapFit, fit_gap
from missing_physics.diagnosis.gear.gap import Gap

__all__ = ["FREE_ORDER", "free_cycle", "is_free", "with_exact_cycle"]

Array = NDArray[np.float64]

#: The shape's name, whatever the order: shut out once, it is not tried with another order.
FREE_ORDER = "an order of its own"
#: Cycles over the way: the fewest, below which a cycle is a slope and a curve, and the grid's step, half of
#: what two orders differ by that are told apart (Rayleigh).
FEWEST, STEP = 0.25, 0.25
#: Peaks of the periodogram that are refined.
PEAKS = 3
#: Relative tolerance of the order.
TOLERANCE = 1e-6
#: Of what is left above the noise, a cycle has to take this part. A cycle that is one does; a curve over the
#: position that is something else, which a series of cycles would describe, leaves more of it to the others.
SHARE = 0.8
#: Speeds below this part of the largest count as standing still, and most cycles over the way that are tried.
STANDSTILL, MOST_CYCLES = 0.02, 1000


def free_cycle(data: GapData, current: GapFit, channel: str, unit: str) -> Cause | None:
    """The cycle that explains most of what `current` leaves; None where none takes its `SHARE` of it.

    Args:
        data: gaps of a joint that turns.
        current: what it comes beside.
        channel: of the encoder that errs.
        unit: of the gap.
    """
    orders = _orders(data)
    if orders.size < 1:
        return None
    falls = _falls(data, current, orders)
    peaks = [i for i in range(orders.size) if falls[i] >= falls[max(i - 1, 0) : i + 2].max()]
    step = STEP * 2 * np.pi / _way(data)
    best: GapFit | None = None
    for i in sorted(peaks, key=lambda i: -falls[i])[:PEAKS]:
        start = _cycle(channel, unit, float(orders[i]), trials=orders.size)
        fit = _refined(data, [*current.causes], start, step)
        if best is None or _error(fit) < _error(best):
            best = fit
    assert best is not None
    floor = data.noise_floor**2 * int(data.fitted.sum())
    above = _error(current) - floor
    if above <= 0 or _error(current) - _error(best) < SHARE * above:
        return None
    return best.causes[-1]


def is_free(cause: Cause) -> bool:
    """Whether a cause is a cycle of free order."""
    return cause.shape == FREE_ORDER


def with_exact_cycle(data: GapData, fit: GapFit) -> GapFit:
    """`fit` with the order of its free cycle fitted beside the other causes it has now."""
    own = next((cause for cause in fit.causes if is_free(cause)), None)
    if own is None:
        return fit
    others = [cause for cause in fit.causes if cause.key != own.key]
    found = _refined(data, others, own, STEP * 2 * np.pi / _way(data))
    exact = found.causes[-1]
    return fit_gap(data, [exact if cause.key == own.key else cause for cause in fit.causes])


def _way(data: GapData) -> float:
    """Travel of the fitted rows [rad]."""
    return max(float(np.ptp(data.position[data.fitted])), 1e-9)


def _orders(data: GapData) -> Array:
    """A grid over what the way shows and the filter passes at the median speed of what moves.

    Samples determine no more cycles than one for two of them.
    """
    speed = np.abs(data.velocity[data.fitted])
    moving = speed[speed > STANDSTILL * max(float(speed.max(initial=0.0)), 1e-12)]
    if moving.size == 0:
        return np.zeros(0)
    cutoff = data.gaps[0].along.motion.low_pass.cutoff
    most = min(cutoff * _way(data) / float(np.median(moving)), moving.size / 2, MOST_CYCLES)
    return np.arange(FEWEST, most, STEP) * 2 * np.pi / _way(data)


def _falls(data: GapData, current: GapFit, orders: Array) -> Array:
    """Energy that a cycle of each order takes away, all else fitted anew, shape (K,)."""
    rows = data.fitted
    fitted = current.matrix[rows]
    basis, _ = np.linalg.qr(fitted / np.maximum(np.linalg.norm(fitted, axis=0), 1e-300))
    left = data.target[rows] - basis @ (basis.T @ data.target[rows])
    falls = np.zeros(orders.size)
    for i, order in enumerate(orders):
        pair = np.column_stack([np.cos(order * data.position[rows]), np.sin(order * data.position[rows])])
        own, _ = np.linalg.qr(pair - basis @ (basis.T @ pair))
        falls[i] = ((own.T @ left) ** 2).sum()
    return falls


def _refined(data: GapData, others: list[Cause], start: Cause, step: float) -> GapFit:
    """`others` and the cycle with the order, within a step of its start, that leaves least."""
    order = start.known[0][1]
    unit = start.meanings[0].unit

    def fitted(order: float, amplitude: tuple[float, float] | None = None) -> GapFit:
        cycle = _cycle(start.location, unit, order, trials=start.trials, amplitude=amplitude)
        return fit_gap(data, [*others, cycle])

    found = minimize_scalar(
        lambda k: _error(fitted(float(k))),
        bounds=(max(order - step, 0.5 * order), order + step),
        method="bounded",
        options={"xatol": TOLERANCE * order},
    )
    best = fitted(float(found.x))
    cosine, sine = best.coefficients[-2:]
    return fitted(float(found.x), (float(cosine), float(sine)))


def _cycle(
    channel: str, unit: str, order: float, *, trials: int, amplitude: tuple[float, float] | None = None
) -> Cause:
    """Cosine and sine and, about an amplitude, the change by the logarithm of the order."""

    def columns(gap: Gap) -> Array:
        return np.column_stack(list(_columns(gap.position, order, amplitude)))

    meanings = (Meaning("cosine", unit), Meaning("sine", unit))
    cycle = Cause(
        "encoder_eccentricity",
        channel,
        FREE_ORDER,
        meanings,
        columns,
        known=(("order", order, "-"),),
        trials=trials,
    )
    if amplitude is None:
        return cycle
    return replace(cycle, meanings=(*meanings, Meaning("order", "-", relative=True)))


def _columns(position: Array, order: float, amplitude: tuple[float, float] | None) -> Iterator[Array]:
    phase = order * position
    yield np.cos(phase)
    yield np.sin(phase)
    if amplitude is not None:
        yield phase * (amplitude[1] * np.cos(phase) - amplitude[0] * np.sin(phase))


def _error(fit: GapFit) -> float:
    return float((fit.residual[fit.data.fitted] ** 2).sum())
