"""The band of frequencies in which torques are compared, and the filter that both sides pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

__all__ = ["DENSE", "Band", "low_passed", "thinned"]

Array = NDArray[np.float64]

#: Order of the Butterworth filter, run forward and backward so that it shifts nothing.
ORDER = 4
#: Samples per period of the end of the smoothing that are kept at least: more hold nothing that it passes,
#: and a spline through ten differs from a sine by 1e-5.
DENSE = 10
#: Torques are filtered below this part of the rate that is kept, so that nothing folds back.
UNFOLDED = 0.4
#: Periods of the cut-off at either end of a recording that the filter spoils.
SPOILED_PERIODS = 2.0


@dataclass(frozen=True)
class Band:
    """Cut-off frequencies, and how samples near rest count.

    Attributes:
        torque: below it torques are compared [Hz].
        motion: of the smoother of the positions, before they are differentiated [Hz].
        rest: weight of samples in which a drive may be at rest, of each; none at all when empty.
    """

    torque: float
    motion: float
    rest: tuple[float, ...] = ()

    def spoiled(self, rate: float) -> int:
        """Samples at either end of a recording at `rate` [Hz] that are not compared."""
        return int(SPOILED_PERIODS * rate / self.torque)


def low_passed(values: Array, *, rate: float, cutoff: float) -> Array:
    """`values` without what is above `cutoff`, along the first axis and without delay.

    Args:
        values: samples, shape (N, ...).
        rate: samples per second [Hz].
        cutoff: frequency at which a quarter of the power is left [Hz].
    """
    settled = min(len(values) - 1, int(3 * SPOILED_PERIODS * rate / cutoff) + 10)
    return np.asarray(signal.sosfiltfilt(_sections(cutoff, rate), values, axis=0, padlen=settled))


@lru_cache(maxsize=16)
def _sections(cutoff: float, rate: float) -> Array:
    return np.asarray(signal.butter(ORDER, cutoff, fs=rate, output="sos"))


def thinned(torque: Array, *, rate: float, smoothing: float) -> tuple[Array, int]:
    """Torques of which every so many samples are enough for smoothed positions, and how many that is.

    Args:
        torque: shape (N, n); columns with NaN stay as they are.
        rate: samples per second [Hz].
        smoothing: end of the positions' filter [Hz].
    """
    stride = max(1, int(rate / (DENSE * smoothing)))
    if stride == 1:
        return torque, stride
    found, known = torque.copy(), np.isfinite(torque).all(axis=0)
    found[:, known] = low_passed(torque[:, known], rate=rate, cutoff=UNFOLDED * rate / stride)
    return found, stride
