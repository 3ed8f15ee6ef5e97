"""Spectrum of what is left: Welch's amplitude density before and after, with the noise floor.

P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", 1967.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from missing_physics.diagnosis.result import ChannelSeries, Result
from missing_physics.reporting import palette
from missing_physics.reporting.figures import Figure, Spec, axis, label, layout, line
from missing_physics.reporting.formatting import number
from missing_physics.reporting.sections.base import Section
from missing_physics.reporting.selection import MOST_CHANNELS, channels, mismatch_of, residuals
from robot_model import Robot

__all__ = ["amplitude_density", "section", "uniform"]

Array = NDArray[np.float64]

FEWEST_SAMPLES = 64
#: Segments of at most this many samples, at least eight of them where the recording allows.
LONGEST_SEGMENT = 8192
SEGMENTS = 8
MOST_POINTS = 1500
OPEN_FIGURES = 2


def section(result: Result, robot: Robot) -> Section | None:
    """One figure per channel, from its longest recording; None when all are too short."""
    figures = []
    for channel in channels(result)[:MOST_CHANNELS]:
        longest = max((s for s in result.series if s.channel == channel), key=lambda s: s.time.size)
        if longest.time.size >= FEWEST_SAMPLES:
            figures.append(_figure(result, longest, len(figures)))
    return (
        Section(anchor="spectrum", heading="Spectrum of what is left", figures=figures) if figures else None
    )


def uniform(time: Array, values: Array) -> tuple[float, Array]:
    """Sampling rate [Hz] and `values` (N,) interpolated linearly onto evenly spaced times, gaps bridged."""
    rate = 1.0 / float(np.median(np.diff(time)))
    finite = np.isfinite(values)
    if not finite.any():
        return rate, np.zeros_like(values)
    grid = np.arange(time[0], time[-1] + 0.5 / rate, 1.0 / rate)
    return rate, np.interp(grid, time[finite], values[finite])


def amplitude_density(time: Array, values: Array) -> tuple[Array, Array]:
    """Frequencies [Hz] above zero and the one-sided amplitude density of `values` [unit/sqrt(Hz)]."""
    rate, even = uniform(time, values)
    segment = min(LONGEST_SEGMENT, max(even.size * 2 // (SEGMENTS + 1), FEWEST_SAMPLES // 2))
    frequency, power = welch(even, fs=rate, nperseg=segment, detrend="constant")
    return frequency[1:], np.sqrt(power[1:])


def _figure(result: Result, series: ChannelSeries, order: int) -> Figure:
    before, after = residuals(series)
    spectra = [amplitude_density(series.time, y) for y in (before, after)]
    frequency = spectra[0][0]
    looks = (("residual before", palette.BEFORE), ("residual after", palette.AFTER))
    data = [line(*_thinned(f, a), name=name, colour=colour) for (f, a), (name, colour) in zip(spectra, looks)]
    if series.noise_floor > 0:
        # White noise of rms s has the one-sided density s sqrt(2 / rate).
        level = series.noise_floor / np.sqrt(max(float(frequency[-1]), 1e-12))
        ends = frequency[[0, -1]]
        data.append(
            line(
                ends,
                np.full(2, level),
                name="noise floor, if white",
                colour=palette.NOISE,
                line={"dash": "dash"},
            )
        )
    return Figure(
        name=f"spectrum-{order}",
        data=data,
        layout=_layout(result, series),
        title=f"{series.channel} in {series.recording}",
        caption="Amplitude density by Welch's method; dotted lines: peaks that were located.",
        height=360,
        folded=order >= OPEN_FIGURES,
    )


def _thinned(frequency: Array, amplitude: Array) -> tuple[Array, Array]:
    """At most `MOST_POINTS`, evenly spread over the logarithm of frequency, the largest of each stretch."""
    if frequency.size <= MOST_POINTS:
        return frequency, amplitude
    edges = np.unique(np.searchsorted(frequency, np.geomspace(frequency[0], frequency[-1], MOST_POINTS)))
    stops = np.append(edges[1:], frequency.size)
    keep = [start + int(np.argmax(amplitude[start:stop])) for start, stop in zip(edges, stops)]
    return frequency[keep], amplitude[keep]


def _layout(result: Result, series: ChannelSeries) -> Spec:
    found = mismatch_of(result, series.channel)
    peaks = [f for f in (found.frequency_hz if found else ()) if f > 0]
    marks = [
        {
            "type": "line",
            "x0": f,
            "x1": f,
            "y0": 0,
            "y1": 1,
            "yref": "paper",
            "line": {"dash": "dot", "width": 1},
        }
        for f in peaks
    ]
    words = [
        {
            "text": label(f"{number(f)} Hz"),
            "x": float(np.log10(f)),
            "y": 1,
            "yref": "paper",
            "showarrow": False,
        }
        | {"xanchor": "left", "yanchor": "top", "font": {"size": 12}}
        for f in peaks
    ]
    logarithmic = {"type": "log", "exponentformat": "power", "dtick": 1}
    return layout(
        xaxis=axis("frequency [Hz]", **logarithmic),
        yaxis=axis(f"residual [{series.unit}/√Hz]", **logarithmic),
        shapes=marks,
        annotations=words,
    )
