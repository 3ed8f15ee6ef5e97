"""The low-pass filter applied to everything that is compared."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from missing_physics.evaluation.band import ORDER, SPOILED_PERIODS, continued, low_passed
from missing_physics.standard.band import SAMPLES_PER_PERIOD

__all__ = ["LowPass"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Values that are transformed at once.
IN_CACHE = 65536


@dataclass(frozen=True)
class LowPass:
    """Zero-phase Butterworth low-pass with decimation.

    Attributes:
        rate: sampling rate of the input [Hz].
        cutoff: -6 dB frequency of both passes together [Hz].
    """

    rate: float
    cutoff: float

    @property
    def stride(self) -> int:
        """Decimation factor."""
        return max(1, int(self.rate / (SAMPLES_PER_PERIOD * self.cutoff)))

    @property
    def edge(self) -> int:
        """Samples spoiled at each end."""
        return int(SPOILED_PERIODS * self.rate / self.cutoff)

    @property
    def independent(self) -> float:
        """Independent samples per kept sample: two per period of the cut-off."""
        return min(1.0, 2.0 * self.cutoff * self.stride / self.rate)

    @property
    def noise_gain(self) -> float:
        """Ratio of the rms of filtered to unfiltered white noise."""
        half = max(3 * self.edge, 1)  # after which the filter has settled
        impulse = np.zeros(2 * half + 1)
        impulse[half] = 1.0
        return float(np.linalg.norm(self.smooth(impulse)))

    def smooth(self, values: Array) -> Array:
        """Filter along the first axis."""
        return low_passed(values, rate=self.rate, cutoff=self.cutoff)

    def reduce(self, values: Array) -> Array:
        """Filter along the first axis, drop the spoiled ends and keep every `stride`-th sample.

        Equal to `smooth` at these samples up to rounding, at a fraction of the cost: a polyphase filter with
        Fourier transforms at the decimated rate.
        """
        samples, every = len(values), self.stride
        kept = self.kept(samples)
        count = len(range(samples)[kept])
        if every == 1 or count == 0:
            return self.smooth(values)[kept]
        # The ends are extended oddly, then by constants, as in `smooth`.
        pad, still = continued(samples, rate=self.rate, cutoff=self.cutoff), 3 * self.edge
        before = pad + still + -(pad + still + kept.start) % every
        instants = fft.next_fast_len(-(-(before + samples + pad + still) // every), real=True)
        gains = _gains(self.rate, self.cutoff, every, instants)
        first = (before + kept.start) // every
        columns = values.reshape(samples, -1)
        found = np.empty((count, columns.shape[1]))
        some = max(1, IN_CACHE // (instants * every))
        for start in range(0, columns.shape[1], some):
            part = columns[:, start : start + some]
            whole = np.empty((instants * every, part.shape[1]))
            inner = whole[before - pad : before + samples + pad]
            inner[pad : pad + samples] = part
            inner[:pad] = 2.0 * part[0] - part[pad:0:-1]
            inner[pad + samples :] = 2.0 * part[-1] - part[-2 : -2 - pad : -1]
            whole[: before - pad], whole[before + samples + pad :] = inner[0], inner[-1]
            spectra = fft.rfft(whole.reshape(instants, every, -1), axis=0)
            passed = (gains[:, None] @ spectra)[:, 0]
            found[:, start : start + some] = fft.irfft(passed, instants, axis=0)[first : first + count]
        return found.reshape(count, *values.shape[1:])

    def kept(self, samples: int) -> slice:
        """Slice of the samples that are kept, out of `samples`."""
        return slice(self.edge, max(self.edge, samples - self.edge), self.stride)


@lru_cache(maxsize=64)
def _gains(rate: float, cutoff: float, every: int, instants: int) -> Complex:
    """Frequency response of each of the `every` polyphase branches, shape (`instants` // 2 + 1, `every`).

    Branch j has the samples m `every` + j of a periodic signal of `instants` `every` samples; the sum over
    branches is the signal, filtered forward and backward, at the samples m `every`.
    """
    length = instants * every
    warped = np.tan(np.arange(length // 2 + 1) * np.pi / length) / np.tan(np.pi * cutoff / rate)
    response = fft.irfft(1.0 / (1.0 + warped ** (2 * ORDER)), length)
    lags = every * np.arange(instants)[:, None] - np.arange(every)
    return np.asarray(fft.rfft(response[lags % length], axis=0))
