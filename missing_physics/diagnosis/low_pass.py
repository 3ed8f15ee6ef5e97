"""The filter that everything passes which is compared."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft, signal

__all__ = ["LowPass"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Order of the Butterworth filter, applied forward and backward.
FILTER_ORDER = 4
#: Samples kept per period of the cut-off.
SAMPLES_PER_PERIOD = 4
#: Periods of the cut-off left out at each end, where the filter has no past or no future.
EDGE_PERIODS = 2.0
#: Above this multiple of the cut-off the filter lets 1e-10 through, both passes together.
NOTHING_ABOVE = 20.0


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
        sections = _sections(self.rate, self.cutoff)
        return np.asarray(signal.sosfiltfilt(sections, values, axis=0, padlen=self._pad(len(values))))

    def reduce(self, values: Array) -> Array:
        """Filter along the first axis, drop the spoiled ends and keep every `stride`-th sample.

        To rounding what `smooth` gives there, at half the cost: the spectrum is multiplied by the square of
        the filter's gain, and folded at the rate of what is kept.
        """
        samples, every = len(values), self.stride
        kept = self.kept(samples)
        count = len(range(samples)[kept])
        if every == 1 or count == 0:
            return self.smooth(values)[kept]
        pad, still = self._pad(samples), 3 * self.edge  # its ends odd, then still, as `smooth` has them
        before = pad + still + -(pad + still + kept.start) % every
        least = -(-(before + samples + pad + still) // (2 * every))
        length = 2 * every * fft.next_fast_len(least, real=True)
        whole = np.empty((length, *values.shape[1:]))
        inner = whole[before - pad : before + samples + pad]
        inner[pad : pad + samples] = values
        inner[:pad] = 2.0 * values[0] - values[pad:0:-1]
        inner[pad + samples :] = 2.0 * values[-1] - values[-2 : -2 - pad : -1]
        whole[: before - pad], whole[before + samples + pad :] = inner[0], inner[-1]
        spectrum = fft.rfft(whole, axis=0, overwrite_x=True)
        folded = _folded(spectrum, self.rate, self.cutoff, every)
        first = (before + kept.start) // every
        return np.asarray(fft.irfft(folded, length // every, axis=0)[first : first + count])

    def _pad(self, samples: int) -> int:
        """By how many samples the ends are continued."""
        return min(samples - 1, 3 * self.edge + 10)

    def kept(self, samples: int) -> slice:
        """Which of `samples` are kept."""
        return slice(self.edge, max(self.edge, samples - self.edge), self.stride)


@lru_cache(maxsize=64)
def _sections(rate: float, cutoff: float) -> Array:
    """The filter's second-order sections; their design takes as long as filtering thousands of samples."""
    return np.asarray(signal.butter(FILTER_ORDER, cutoff, fs=rate, output="sos"))


def _folded(spectrum: Complex, rate: float, cutoff: float, every: int) -> Complex:
    """Spectrum of every `every`-th sample after the filter, of that of all samples before it.

    Args:
        spectrum: of an even number L of samples, shape (L/2 + 1, ...), L a multiple of 2 `every`.
    """
    length = 2 * (len(spectrum) - 1)
    kept, half = length // every, length // every // 2
    top = min(int(NOTHING_ABOVE * cutoff / rate * length), length // 2 - 1)
    warped = np.tan(np.arange(top + 1) * np.pi / length) / np.tan(np.pi * cutoff / rate)
    gain = 1.0 / (1.0 + warped ** (2 * FILTER_ORDER)) / every
    weighted = spectrum[: top + 1] * gain.reshape(-1, *[1] * (spectrum.ndim - 1))
    folded = np.zeros((half + 1, *spectrum.shape[1:]), dtype=complex)
    for middle in range(0, top + half + 1, kept):
        above = weighted[middle : middle + half + 1]
        folded[: len(above)] += above
        if middle:  # and mirrored what lies below a multiple of the new rate
            below = weighted[middle - half : middle + 1].conj()  # of frequencies half, half - 1, ...
            folded[half - np.arange(len(below))] += below
    return folded
