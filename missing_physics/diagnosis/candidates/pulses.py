"""When a constant torque would explain most: the first guess for what acts for a time only.

Stretches in which the residual stands out are a poor guess where the nominal robot's numbers were estimated
with it: they take over a part of a long push and spread the rest over the whole recording. So every pair of
instants on a grid is tried, everything that is fitted anew beside it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.scanning import Scan

__all__ = ["likeliest_pulses"]

Array = NDArray[np.float64]

#: Instants that are tried.
EDGES = 96
#: How much closer they are each time that the best are looked at again.
FINER = 6
#: Energies that differ by less than this part are the same.
ALIKE = 1e-9
#: What lasts longer than this part of a recording is no event.
LONGEST = 0.25
#: Guesses, and how much of the shorter of two may be in the other.
GUESSES, SHARED = 3, 0.5


def likeliest_pulses(scan: Scan, time: Array, output: int) -> tuple[tuple[float, float], ...]:
    """The stretches in which a constant torque at an output explains most, best first [(s, s)].

    Args:
        scan: of what is left.
        time: of the rows [s], shape (R,).
        output: index among the problem's.
    """
    edges = np.linspace(float(time.min()), float(time.max()), EDGES)
    step = float(edges[1] - edges[0])
    fall = scan.pulses(output, edges)
    fall[edges - edges[:, None] > LONGEST * (edges[-1] - edges[0])] = 0.0
    found: list[tuple[float, float]] = []
    for place in np.argsort(-fall, axis=None):
        first, last = np.unravel_index(place, fall.shape)
        if fall[first, last] <= 0.0 or len(found) == GUESSES:
            break
        start, stop = float(edges[first]), float(edges[last])
        if all(min(stop, b) - max(start, a) < SHARED * min(stop - start, b - a) for a, b in found):
            found.append((start, stop))
    return tuple(_sharper(scan, time, output, pulse, step) for pulse in found)


def _sharper(
    scan: Scan, time: Array, output: int, pulse: tuple[float, float], step: float
) -> tuple[float, float]:
    """The same to a row, from one to `step` [s]: a fit finds no edge from further than the filter is wide."""
    row = float(np.median(np.diff(time)))
    around = np.linspace(-1.0, 1.0, 2 * FINER + 1)
    while step > row and pulse[1] - pulse[0] > 2.0 * step:
        edges = np.concatenate([end + step * around for end in pulse])
        fall = scan.pulses(output, edges)[: around.size, around.size :]
        first, last = np.unravel_index(np.argmax(fall), fall.shape)
        # where rows are missing around an end, every instant in the gap does as well: its middle
        alike = fall >= (1.0 - ALIKE) * fall[first, last]
        start, stop = edges[: around.size][alike[:, last]], edges[around.size :][alike[first]]
        pulse = float(start.mean()), float(stop.mean())
        step /= FINER
    return pulse
