"""The filter that everything passes which is compared."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

__all__ = ["LowPass"]

Array = NDArray[np.float64]

#: Order of the Butterworth filter, applied forward and backward.
FILTER_ORDER = 4
#: Samples kept per period of the cut-off.
SAMPLES_PER_PERIOD = 4
#: Periods of the cut-off left out at each end, where the filter has no past or no future.
EDGE_PERIODS = 2.0


@dataclass(frozen=True)
class LowPass:
    """Zero-phase Butterworth low-pass with decimation.

    Attributes:
        rate: sampling rate of what goes in [Hz].
        cutoff: -6 dB frequency of both passes together [Hz].
    """

    rate: float
    cutoff: float

    @property
    def stride(self) -> int:
        """Every how many samples one is kept."""
        return max(1, int(self.rate / (SAMPLES_PER_PERIOD * self.cutoff)))

    @property
    def edge(self) -> int:
        """Samples spoiled at each end."""
        return int(EDGE_PERIODS * self.rate / self.cutoff)

    def smooth(self, values: Array) -> Array:
        """Filter along the first axis."""
        pad = min(len(values) - 1, 3 * self.edge + 10)
        return np.asarray(signal.sosfiltfilt(_sections(self.rate, self.cutoff), values, axis=0, padlen=pad))

    def reduce(self, values: Array) -> Array:
        """Filter along the first axis, drop the spoiled ends and keep every `stride`-th sample."""
        return self.smooth(values)[self.kept(len(values))]

    def kept(self, samples: int) -> slice:
        """Which of `samples` are kept."""
        return slice(self.edge, max(self.edge, samples - self.edge), self.stride)


@lru_cache(maxsize=64)
def _sections(rate: float, cutoff: float) -> Array:
    """The filter's second-order sections; their design takes as long as filtering thousands of samples."""
    return np.asarray(signal.butter(FILTER_ORDER, cutoff, fs=rate, output="sos"))
