"""The frequency band in which torques are compared, and the filter applied to both sides."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

__all__ = ["DENSE", "ORDER", "SPOILED_PERIODS", "Band", "continued", "low_passed", "thinned"]

Array = NDArray[np.float64]

#: Order of the Butterworth filter, run forward and backward for zero phase.
ORDER = 4
#: Fewest samples kept per period of the smoothing cut-off: a spline through ten samples per period differs
#: from a sine by 1e-5.
DENSE = 10
#: Anti-aliasing cut-off of torques as a fraction of the reduced sampling rate.
UNFOLDED = 0.4
#: Periods of the cut-off at either end of a recording that are spoiled by the filter.
SPOILED_PERIODS = 2.0


@dataclass(frozen=True)
class Band:
    """Cut-off frequencies, and the weight of samples near rest.

    Attributes:
        torque: cut-off below which torques are compared [Hz].
        motion: cut-off of the filter that smooths positions before they are differentiated [Hz].
        rest: for each drive, the weight of samples in which it may be at rest; zero if empty.
    """

    torque: float
    motion: float
    rest: tuple[float, ...] = ()

    def spoiled(self, rate: float) -> int:
        """Samples at either end of a recording at `rate` [Hz] that are not compared."""
        return int(SPOILED_PERIODS * rate / self.torque)


def low_passed(values: Array, *, rate: float, cutoff: float) -> Array:
    """`values` low-passed at `cutoff` along the first axis, without delay.

    Args:
        values: samples, shape (N, ...).
        rate: samples per second [Hz].
        cutoff: frequency at which a quarter of the power passes [Hz].
    """
    sections, settled_state = _sections(cutoff, rate)
    settled = continued(len(values), rate=rate, cutoff=cutoff)
    rows = np.moveaxis(np.asarray(values, dtype=float), 0, -1)
    # Beyond the ends the series is extended oddly, as in `scipy.signal.sosfiltfilt`.
    before = 2.0 * rows[..., :1] - rows[..., settled:0:-1]
    after = 2.0 * rows[..., -1:] - rows[..., -2 : -settled - 2 : -1]
    found = np.concatenate([before, rows, after], axis=-1)
    state = settled_state.reshape(len(sections), *[1] * (rows.ndim - 1), 2)
    for _ in range(2):  # forward, then backward
        found = signal.sosfilt(sections, found, zi=state * found[..., :1])[0][..., ::-1]
    return np.moveaxis(found[..., settled : settled + len(values)], -1, 0)


def continued(samples: int, *, rate: float, cutoff: float) -> int:
    """Samples by which a series is extended beyond each of its ends, for the filter to settle."""
    return min(samples - 1, int(3 * SPOILED_PERIODS * rate / cutoff) + 10)


@lru_cache(maxsize=16)
def _sections(cutoff: float, rate: float) -> tuple[Array, Array]:
    """Second-order sections of the filter, and their steady state for a constant input of one."""
    sections = np.asarray(signal.butter(ORDER, cutoff, fs=rate, output="sos"))
    return sections, np.asarray(signal.sosfilt_zi(sections))


def thinned(torque: Array, *, rate: float, smoothing: float) -> tuple[Array, int]:
    """Torques low-passed for decimation to the rate that smoothed positions need, and the decimation factor.

    Args:
        torque: shape (N, n); columns with NaN are left unchanged.
        rate: samples per second [Hz].
        smoothing: cut-off of the position filter [Hz].
    """
    stride = max(1, int(rate / (DENSE * smoothing)))
    if stride == 1:
        return torque, stride
    found, known = torque.copy(), np.isfinite(torque).all(axis=0)
    found[:, known] = low_passed(torque[:, known], rate=rate, cutoff=UNFOLDED * rate / stride)
    return found, stride
