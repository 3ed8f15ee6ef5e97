"""Sums over each band from which everything else follows: they do not grow with the length of a recording.

The unexplained force of a joint is Gaussian with one level in each band (Whittle, "The analysis of multiple
stationary time series", J. Royal Statistical Society B 15 (1953)). What is needed of a residual r and of the
columns X in which a model is linear is the Hermitian matrix ``[r X]^H [r X]`` of their Fourier transforms,
summed over the bins of each band.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.likelihood.bands import Spectrum

__all__ = ["Gram", "Whitener"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: The whitening filter has forgotten what came before its first sample when this part of its energy is left.
FORGOTTEN = 1e-4
#: At most this part of a recording goes into its memory.
LONGEST_MEMORY = 0.1


@dataclass(frozen=True)
class Whitener:
    """Turns series of one joint of one recording into series of which the unexplained part is white.

    Attributes:
        spectrum: reference spectrum of the unexplained force.
        weight: one over the standard deviation of the whitened unexplained part at each sample, shape (N,);
            small where the joint rests or reverses and friction may be anything.
        rate: sampling rate [Hz].
    """

    spectrum: Spectrum
    weight: Array
    rate: float

    def series(self, columns: Array) -> Array:
        """Whitened and weighted columns, shape (N - memory, C)."""
        count = len(columns)
        transfer = self.spectrum.whitener(2 * count, self.rate)
        padded = np.fft.rfft(columns, 2 * count, axis=0)
        white = np.fft.irfft(transfer[:, None] * padded, 2 * count, axis=0)[:count]
        start = _memory(transfer, count)
        return np.asarray((white * self.weight[:, None])[start:])

    def spectra(self, columns: Array) -> Complex:
        """Fourier transforms of `series`, a white process of variance one having unit power per bin."""
        series = self.series(columns)
        series = series[len(series) % 2 :]  # an even number of samples, of which the length follows
        return np.asarray(np.fft.rfft(series, axis=0) / np.sqrt(len(series)))


@dataclass(frozen=True)
class Gram:
    """Band sums of one joint; K columns, the first of them the residual.

    Attributes:
        products: Hermitian, shape (B, K, K).
        count: bins in each band, shape (B,).
    """

    products: Complex
    count: Array

    @classmethod
    def of(cls, whitener: Whitener, columns: Array) -> Gram:
        """Of columns at the samples of one recording, shape (N, K)."""
        spectra = whitener.spectra(columns)
        spectra[[0, -1]] *= np.sqrt(0.5)  # these two bins are real: half as many numbers as in the others
        parts = whitener.spectrum.bands.parts(2 * (len(spectra) - 1), whitener.rate)
        products = np.array([spectra[p].conj().T @ spectra[p] for p in parts])
        count = np.array([float(p.stop - p.start) for p in parts])
        count[[0, -1]] -= 0.5
        return cls(products, np.maximum(count, 0.0))

    def __add__(self, other: Gram) -> Gram:
        return Gram(self.products + other.products, self.count + other.count)


def _memory(transfer: Complex, count: int) -> int:
    """Samples until a filter has forgotten what came before."""
    response = np.fft.irfft(transfer, 2 * count)[:count]
    energy = np.cumsum(response[::-1] ** 2)[::-1]
    return int(min(np.argmax(energy <= FORGOTTEN * energy[0]) or count, LONGEST_MEMORY * count))
