"""Whether held-out data show the fitted motion over again.

Along the same motion every force that depends on the motion comes back, whatever its law. That a curve
foretells it there says that something is left, and nothing of its shape.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Problem

__all__ = ["repeats"]

Array = NDArray[np.float64]

#: Positions that differ by less than this part of their spread (rms) are the same motion.
SAME = 0.05
#: Instants at which a held-out motion is compared, and least part of it that must lie within the other.
INSTANTS, OVERLAP = 240, 0.5
#: Within one recording, the least shift, as a part of what is compared: a motion is always near its own.
SHIFT = 0.1


def repeats(fitted: Problem, held_out: Problem) -> bool:
    """Whether every held-out recording is, at some shift in time, what a fitted one shows.

    Where stretches of the same recordings are held out, whether these repeat themselves.
    """
    same = fitted is held_out
    others = [_motion(fitted, number) for number in range(len(fitted.segments))]
    return all(
        any(
            _comes_again(*_motion(held_out, number), *other, itself=same and k == number)
            for k, other in enumerate(others)
        )
        for number in range(len(held_out.segments))
    )


def _motion(problem: Problem, number: int) -> tuple[Array, Array]:
    """Time and positions of one recording, shape (N,) and (N, n)."""
    own = problem.segment_of == number
    return problem.time[own], problem.position[own]


def _comes_again(time: Array, motion: Array, seen_time: Array, seen: Array, *, itself: bool) -> bool:
    """Whether `motion` lies on `seen` at some shift, in all joints that move."""
    step = float(time[-1] - time[0]) / INSTANTS
    if step <= 0 or seen_time[-1] - seen_time[0] < OVERLAP * (time[-1] - time[0]):
        return False
    one, other = _resampled(time, motion, step), _resampled(seen_time, seen, step)
    spread = one.std(0)
    moving = spread > SAME * max(float(spread.max()), 1e-12)
    one, other = one[:, moving] / spread[moving], other[:, moving] / spread[moving]
    least = int(np.ceil(OVERLAP * len(one)))
    for shift in range(least - len(one), len(other) - least + 1):
        if itself and abs(shift) < SHIFT * len(one):
            continue
        first, last = max(0, -shift), min(len(one), len(other) - shift)
        gap = one[first:last] - other[first + shift : last + shift]
        if last - first >= least and np.sqrt(np.mean(gap**2)) < SAME:
            return True
    return False


def _resampled(time: Array, values: Array, step: float) -> Array:
    grid = np.arange(time[0], time[-1] + step / 2, step)
    return np.column_stack([np.interp(grid, time, column) for column in values.T])
