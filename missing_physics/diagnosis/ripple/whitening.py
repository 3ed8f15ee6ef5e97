"""The filter above the band of the motion after which the residual of a torque is white noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import median_filter
from scipy.signal import csd, welch

__all__ = ["Whitening"]

Array = NDArray[np.float64]

#: Segments of the estimate of a spectrum last so many periods of the band's lower end.
PERIODS = 4.0
#: Points per octave of a smoothed spectrum, which is the median over an octave: lines do not change it.
PER_OCTAVE = 24
#: Order of the flanks of the band.
FLANK = 8


@dataclass(frozen=True)
class Whitening:
    """A zero-phase filter that divides by the amplitude spectrum of the noise within a band.

    Attributes:
        low, high: the band [Hz].
        frequencies: at which the gain is given, rising, shape (F,) [Hz].
        gain: at these, shape (F,).
        level: rms of white noise after the filter, equal to that of the noise in the band before.
        shared: fraction of a column that the recorded torque shares, shape (F,); None for all of it.
    """

    low: float
    high: float
    frequencies: Array
    gain: Array
    level: float
    shared: Array | None = None

    @classmethod
    def of(cls, series: Sequence[Array], rates: Sequence[float], *, low: float, high: float) -> Self | None:
        """The filter of the residuals of one joint; None where these are zero in the band.

        Args:
            series: one residual for each recording, (N,) each.
            rates: their sampling rates [Hz].
            low, high: the band [Hz], below half of every rate.
        """
        octaves = np.log2(high / low)
        grid = low * 2.0 ** (np.arange(int(PER_OCTAVE * octaves) + 1) / PER_OCTAVE)
        smooth = _smoothed([(own, own) for own in series], rates, low, grid)
        if not smooth.min() > 0.0:
            return None
        flank = (grid / low) ** FLANK / (1.0 + (grid / low) ** FLANK) / (1.0 + (grid / high) ** FLANK)
        gain = flank / np.sqrt(smooth)
        level = float(np.sqrt(np.trapezoid(smooth * flank**2, grid)))
        white = float(np.sqrt(np.trapezoid(smooth * gain**2, grid)))
        return cls(low, high, grid, gain * level / white, level)

    def sharing(
        self, columns: Sequence[Array], recorded: Sequence[Array], rates: Sequence[float]
    ) -> Whitening:
        """The filter with the part of a column that is no noise of the encoders (Wiener's filter).

        An acceleration is the second difference of positions and mostly their noise at high frequency. The
        recorded torque contains the true acceleration and not that noise, so that the ratio of their cross
        spectrum to the column's own is the fraction of the column that is true.

        Args:
            columns: of one joint in each recording, (N,) each.
            recorded: its torques, likewise.
            rates: sampling rates [Hz].
        """
        pairs = [(one, one) for one in columns], list(zip(columns, recorded))
        own, common = (_smoothed(each, rates, self.low, self.frequencies) for each in pairs)
        return replace(self, shared=np.clip(common / np.maximum(own, np.finfo(float).tiny), 0.0, 1.0))

    def of_column(self, values: Array, rate: float) -> Array:
        """A filtered column, (N, ...), without the part that the recorded torque does not share."""
        gain = self.gain if self.shared is None else self.gain * self.shared
        return replace(self, gain=gain)(values, rate)

    def __call__(self, values: Array, rate: float) -> Array:
        """A filtered series, (N, ...), sampled at a rate [Hz]; its ends are spoiled."""
        count = len(values)
        padded = next_fast_len(2 * count, real=True)
        frequencies = np.fft.rfftfreq(padded, 1.0 / rate)
        gain = np.interp(frequencies, self.frequencies, self.gain, left=0.0, right=0.0)
        rows = np.moveaxis(values, 0, -1)
        turned = np.concatenate([rows, rows[..., ::-1]], axis=-1)  # without a step between the ends
        return np.moveaxis(irfft(rfft(turned, padded) * gain, padded)[..., :count], -1, 0)


def _smoothed(pairs: Sequence[tuple[Array, Array]], rates: Sequence[float], low: float, grid: Array) -> Array:
    """Real cross spectrum of series, the median over an octave, at the frequencies of a grid, shape (F,)."""
    spectra = []
    for (one, other), rate in zip(pairs, rates):
        length = min(max(64, int(PERIODS * rate / low)), len(one))
        estimate = (
            welch(one, fs=rate, nperseg=length) if one is other else csd(one, other, rate, nperseg=length)
        )
        spectra.append(np.interp(grid, estimate[0], np.real(estimate[1])))
    lasting = [len(one) / rate for (one, _), rate in zip(pairs, rates)]
    smooth = np.average(spectra, axis=0, weights=lasting)
    return np.asarray(median_filter(smooth, size=min(PER_OCTAVE, smooth.size) + 1, mode="nearest"))
