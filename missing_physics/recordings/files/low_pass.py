"""Inverse of a known second-order low-pass filter of a channel's recorder."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.maps.mapping import LowPassFilter

__all__ = ["before_low_pass"]

Array = NDArray[np.float64]


def before_low_pass(time: Array, values: Array, low_pass: LowPassFilter) -> Array:
    """The filter's input: ``u = y + 2 d/w y' + y''/w^2``, by central differences; needs no initial state.

    Noise added after the filter grows with the square of the frequency. At both ends the second derivative is
    that of the neighbour. A missing value spoils its neighbours.

    Args:
        time: instants [s], shape (N,), N at least 3.
        values: the recorded values, shape (N,).
        low_pass: the filter.

    Returns:
        Shape (N,), unit of `values`.
    """
    w = 2.0 * np.pi * low_pass.frequency
    slopes = np.diff(values) / np.diff(time)
    second = np.pad(2.0 * np.diff(slopes) / (time[2:] - time[:-2]), 1, mode="edge")
    first = np.gradient(values, time, edge_order=2)
    return np.asarray(values + 2.0 * low_pass.damping_ratio / w * first + second / w**2)
