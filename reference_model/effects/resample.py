"""Interpolation of a sampled signal, for sensor effects that shift time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

__all__ = ["value_at"]


def value_at(
    time: NDArray[np.float64], values: NDArray[np.float64], instants: NDArray[np.float64]
) -> NDArray[np.float64]:
    """`values`, sampled at `time`, interpolated at `instants`; constant beyond the first and last sample.

    A monotone cubic (PCHIP) is used: it does not overshoot where a signal jumps, as a torque with dry
    friction does. Missing values (NaN) are skipped; with fewer than two others, `values` are returned.

    Args:
        time: increasing, shape (N,) [s].
        values: shape (N,), in the channel's unit.
        instants: shape (M,) [s].
    """
    known = np.isfinite(values)
    if known.sum() < 2:
        return np.array(values, dtype=float)
    inside = np.clip(instants, time[known][0], time[known][-1])
    return np.asarray(PchipInterpolator(time[known], values[known])(inside))
