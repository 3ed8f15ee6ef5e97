"""Blocks of time: what lies within one is taken for one observation, as errors have a memory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["block_columns", "blocks"]

Array = NDArray[np.float64]

#: Blocks aimed at over all recordings, and the shortest block [s].
BLOCKS = 48
SHORTEST_BLOCK = 0.25


def blocks(times: Sequence[NDArray[np.float64]]) -> NDArray[np.int_]:
    """Number of the block of each instant, rising over all recordings, shape (R,).

    Args:
        times: of each recording [s], rising.
    """
    length = max(sum(time[-1] - time[0] for time in times) / BLOCKS, SHORTEST_BLOCK)
    numbers, first = [], 0
    for time in times:
        span = time - time[0]
        count = max(1, round(float(span[-1]) / length))
        own = np.minimum((span / (span[-1] / count)).astype(int), count - 1)
        numbers.append(first + own)
        first += count
    return np.concatenate(numbers)


def block_columns(columns: Array, segment_of: NDArray[np.int_]) -> Array:
    """Columns (R, n, k) of each segment by itself, shape (R, n, k times the number of segments)."""
    numbers = np.unique(segment_of)
    parts = [np.where((segment_of == number)[:, None, None], columns, 0.0) for number in numbers]
    return np.concatenate(parts, axis=2)
