"""Decimation for plots that keeps every spike."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["envelope_indices", "intervals"]


def envelope_indices(values: NDArray[np.float64], limit: int) -> NDArray[np.intp]:
    """Indices of the samples to draw: minimum and maximum of each of `limit` // 2 stretches.

    Args:
        values: shape (N,); NaN marks a gap.
        limit: largest number of samples, at least 4.

    Returns:
        Increasing indices, shape (M,) with M <= `limit`; all of them if N <= `limit`. They include the
        first and the last sample, and the extremes of the complete series.
    """
    count = values.size
    if count <= limit:
        return np.arange(count)
    edges = np.linspace(0, count, max((limit - 2) // 2, 1) + 1).astype(np.intp)[:-1]
    finite = np.isfinite(values)
    lowest = _argument(np.where(finite, values, np.inf), edges, np.minimum)
    highest = _argument(np.where(finite, values, -np.inf), edges, np.maximum)
    return np.unique(np.concatenate(([0, count - 1], lowest, highest)))


def intervals(
    time: NDArray[np.float64], flag: NDArray[np.bool_], limit: int = 200
) -> tuple[tuple[float, float], ...]:
    """Stretches [s] in which `flag` holds; gaps are closed, shortest first, until at most `limit` remain."""
    if not flag.any():
        return ()
    padded = np.concatenate(([False], flag, [False]))
    changes = np.flatnonzero(padded[1:] != padded[:-1])
    starts, stops = time[changes[0::2]], time[changes[1::2] - 1]
    if starts.size > limit:
        gaps = starts[1:] - stops[:-1]
        keep = np.sort(np.argsort(gaps)[gaps.size - (limit - 1) :])
        starts = np.concatenate((starts[:1], starts[1:][keep]))
        stops = np.concatenate((stops[:-1][keep], stops[-1:]))
    return tuple((float(a), float(b)) for a, b in zip(starts, stops))


def _argument(values: NDArray[np.float64], edges: NDArray[np.intp], reduce: np.ufunc) -> NDArray[np.intp]:
    """Index of the extreme of every stretch that begins at `edges`."""
    extreme = reduce.reduceat(values, edges)
    lengths = np.diff(np.append(edges, values.size))
    hits = np.flatnonzero(values == np.repeat(extreme, lengths))
    stretch = np.searchsorted(edges, hits, side="right") - 1
    _, first = np.unique(stretch, return_index=True)
    return hits[first]
