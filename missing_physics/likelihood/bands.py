"""Frequency bands in which the unexplained force of a joint has one level each."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = ["Bands", "Spectrum"]

Array = NDArray[np.float64]

#: Bands are half an octave wide: narrow enough for the slopes of real spectra, wide enough to be estimated.
RATIO = 2.0**0.5
#: Bins of the longest recording in the lowest band, that of the mean included.
LOWEST_BINS = 6


@dataclass(frozen=True)
class Bands:
    """Edges of the bands [Hz], shape (B + 1,): the first is zero, the last Nyquist's frequency."""

    edges: Array

    @classmethod
    def of(cls, duration: float, rate: float) -> Bands:
        """Of recordings sampled at `rate` [Hz] of which the longest lasts `duration` [s]."""
        nyquist = 0.5 * rate
        first = min((LOWEST_BINS - 0.5) / duration, nyquist / RATIO)
        count = max(1, round(np.log(nyquist / first) / np.log(RATIO)))
        return cls(np.concatenate([[0.0], np.geomspace(first, nyquist, count + 1)]))

    @property
    def count(self) -> int:
        """Number of bands."""
        return self.edges.size - 1

    @property
    def centres(self) -> Array:
        """Geometric middle of each band, of the lowest its arithmetic one [Hz], shape (B,)."""
        lower = np.maximum(self.edges[:-1], 0.25 * self.edges[1])
        return np.asarray(np.sqrt(lower * self.edges[1:]))

    def parts(self, samples: int, rate: float) -> list[slice]:
        """Bins of the half-sided Fourier transform of `samples` values that lie in each band."""
        bins = samples // 2 + 1
        cuts = np.ceil(self.edges * samples / rate - 1e-9).astype(int)
        cuts[0], cuts[-1] = 0, bins
        cuts = np.clip(cuts, 0, bins)
        return [slice(int(a), int(max(a, b))) for a, b in pairwise(cuts)]


@dataclass(frozen=True)
class Spectrum:
    """Power of an unexplained force, log-linear between the centres of bands and level beyond them.

    Attributes:
        bands: the bands.
        power: variance per sample that a white process of this density has [(N m)^2 or N^2], shape (B,).
    """

    bands: Bands
    power: Array

    def at(self, samples: int, rate: float) -> Array:
        """At the bins of a half-sided Fourier transform, shape (samples // 2 + 1,)."""
        frequency = np.fft.rfftfreq(samples, 1.0 / rate)
        centres = self.bands.centres
        logs = np.interp(np.log(np.maximum(frequency, centres[0])), np.log(centres), np.log(self.power))
        return np.asarray(np.exp(logs))

    def whitener(self, samples: int, rate: float) -> NDArray[np.complex128]:
        """Transfer function of the minimum-phase filter that makes this process white of variance one.

        By the folded cepstrum (Oppenheim and Schafer, Discrete-Time Signal Processing, ch. 13), shape
        (samples // 2 + 1,).
        """
        half = -0.5 * np.log(self.at(samples, rate))
        cepstrum = np.fft.irfft(half, samples)
        fold = np.zeros(samples)
        fold[0] = 1.0
        fold[1 : (samples + 1) // 2] = 2.0
        if samples % 2 == 0:
            fold[samples // 2] = 1.0
        return np.asarray(np.exp(np.fft.rfft(cepstrum * fold)))
