"""The range that one recording covers at a joint, and starting values for fits of effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from reference_model.effects.base import Extent

__all__ = ["EDGES", "FEWEST_CYCLES", "STANDSTILL", "Sight", "extent_of"]

Array = NDArray[np.float64]

#: Speeds below this fraction of the largest one count as rest.
STANDSTILL = 0.02
#: Fewest cycles over the travel that distinguish a wave from a slope; number of spectral peaks tried.
FEWEST_CYCLES, PEAKS = 0.75, 2
#: Position bins for the spectrum over position.
BINS = 4096
#: Edges of the grid on which pulses are searched, longest pulse as a fraction of the recording, number of
#: pulses tried, and largest overlap of two pulses as a fraction of the shorter one.
EDGES, LONGEST, PULSES, SHARED = 120, 0.4, 3, 0.3


@dataclass(frozen=True)
class Sight:
    """One joint in one recording, K rows.

    Attributes:
        time, position, velocity, torque, residual: at the rows, shape (K,).
        step: sampling time of the recording [s].
        cutoff: end of the band [Hz].
        gear_ratio: motor turns per joint turn.
    """

    time: Array
    position: Array
    velocity: Array
    torque: Array
    residual: Array
    step: float
    cutoff: float
    gear_ratio: float


def extent_of(sight: Sight) -> Extent:
    """The range from which effects choose their starting values."""
    speed = np.abs(sight.velocity)
    moving = speed[speed > STANDSTILL * max(float(speed.max()), 1e-12)]
    return Extent(
        position=(float(sight.position.min()), float(sight.position.max())),
        speed=float(speed.max()),
        slow=float(np.quantile(moving, 0.1)) if moving.size else 0.0,
        torque=_rms(sight.torque),
        peak_torque=float(np.abs(sight.torque).max()),
        residual=_rms(sight.residual),
        duration=float(sight.time[-1] - sight.time[0]),
        sample_time=sight.step,
        gear_ratio=sight.gear_ratio,
        windows=_pulses(sight),
        orders=_orders(sight),
        begin=float(sight.time[0]),
    )


def _orders(sight: Sight) -> tuple[float, ...]:
    """Strongest angular orders over position of the residual, and of the residual times the direction."""
    travel = float(np.ptp(sight.position))
    speed = np.abs(sight.velocity)
    moving = speed > STANDSTILL * max(float(speed.max()), 1e-12)
    if travel <= 0.0 or moving.sum() < 2 * PEAKS:
        return ()
    highest = 2.0 * np.pi * sight.cutoff / max(float(np.median(speed[moving])), 1e-12)
    lowest = 2.0 * np.pi * FEWEST_CYCLES / travel
    count = int(min(BINS, max(64, 4 * travel * highest / (2.0 * np.pi))))
    place = (sight.position[moving] - sight.position.min()) / travel * count
    bins = np.clip(place.astype(int), 0, count - 1)
    orders = 2.0 * np.pi * np.arange(2 * count + 1) / (4.0 * travel)
    found: list[float] = []
    for values in (sight.residual, sight.residual * np.sign(sight.velocity)):
        centred = values[moving] - values[moving].mean()
        power = np.abs(np.fft.rfft(np.bincount(bins, centred, count), 4 * count)) ** 2
        power[(orders < lowest) | (orders > highest)] = 0.0
        peaks, _ = find_peaks(power)
        found += [float(orders[i]) for i in peaks[np.argsort(-power[peaks])][:PEAKS]]
    return tuple(found)


def _pulses(sight: Sight) -> tuple[tuple[float, float], ...]:
    """The time intervals in which a constant explains most of the residual, best first [s]."""
    count = sight.time.size
    edges = np.unique(np.linspace(0, count, EDGES + 1).astype(int))
    total = np.concatenate([[0.0], np.cumsum(sight.residual - sight.residual.mean())])[edges]
    first, last = np.triu_indices(edges.size, 1)
    length = (edges[last] - edges[first]).astype(float)
    energy = (total[last] - total[first]) ** 2 / np.maximum(length * (1.0 - length / count), 1.0)
    energy[length > LONGEST * count] = 0.0
    found: list[tuple[float, float]] = []
    for k in np.argsort(-energy)[: EDGES**2 // 4]:
        start, stop = sight.time[edges[first[k]]], sight.time[min(edges[last[k]], count - 1)]
        if all(min(stop, b) - max(start, a) < SHARED * min(stop - start, b - a) for a, b in found):
            found.append((float(start), float(stop)))
        if len(found) == PULSES:
            break
    return tuple(found)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
