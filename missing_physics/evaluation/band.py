"""The band of frequencies in which torques are compared, and the filter that both sides pass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

__all__ = ["Band", "low_passed"]

Array = NDArray[np.float64]

#: Order of the Butterworth filter, run forward and backward so that it shifts nothing.
ORDER = 4
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
    sections = signal.butter(ORDER, cutoff, fs=rate, output="sos")
    settled = min(len(values) - 1, int(3 * SPOILED_PERIODS * rate / cutoff) + 10)
    return np.asarray(signal.sosfiltfilt(sections, values, axis=0, padlen=settled))
