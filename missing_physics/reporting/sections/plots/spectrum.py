"""Spectrum of the residual: Welch's amplitude density before and after, with the noise floor.

P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", 1967.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.figures import Figure, Spec, axis, label, layout, line
from missing_physics.reporting.elements.formatting import number
from missing_physics.reporting.elements.selection import (
    MOST_CHANNELS,
    channels,
    mismatch_of,
    residuals,
    short_names,
)
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import ChannelSeries, Result
from robot_model import Robot

__all__ = ["amplitude_density", "section", "uniform"]

Array = NDArray[np.float64]

FEWEST_SAMPLES = 64
#: Segments of at most this many samples, at least eight of them where the recording allows.
LONGEST_SEGMENT = 8192
SEGMENTS = 8
MOST_POINTS = 1500
OPEN_FIGURES = 2
#: Rounding errors far below the signal are not drawn.
MOST_DECADES = 6.0
#: Below this many decades an axis has labels between the powers of ten.
FEW_DECADES = 1.6


def section(result: Result, robot: Robot) -> Section | None:
    """One figure per channel, from its longest recording; None when all are too short."""
    figures: list[Figure] = []
    for channel in channels(result)[:MOST_CHANNELS]:
        longest = max((s for s in result.series if s.channel == channel), key=lambda s: s.time.size)
        if longest.time.size >= FEWEST_SAMPLES:
            figures.append(_figure(result, longest, len(figures)))
    return (
        Section(anchor="spectrum", heading="Spectrum of the residual", figures=figures) if figures else None
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
    spectra = [amplitude_density(series.time, values) for values in residuals(series)]
    looks = (("residual before", palette.BEFORE), ("residual after", palette.AFTER))
    data = [
        line(*_thinned(*found), name=name, colour=colour) for found, (name, colour) in zip(spectra, looks)
    ]
    found = mismatch_of(result, series.channel)
    peaks = [f for f in (found.frequency_hz if found else ()) if f > 0]
    frequency, amplitudes = spectra[0][0], np.concatenate([amplitude for _, amplitude in spectra])
    words = " Dotted: peaks that were located." if peaks else ""
    return Figure(
        name=f"spectrum-{order}",
        data=[*data, *_noise(series, frequency)],
        layout=layout(
            xaxis=axis("frequency [Hz]", **_logarithmic(frequency)),
            yaxis=axis(f"residual [{series.unit}/√Hz]", **_logarithmic(amplitudes)),
            shapes=[_mark(f) for f in peaks],
            annotations=[_mark_text(f, order) for order, f in enumerate(peaks)],
        ),
        title=f"{series.channel} in {short_names(result)[series.recording]}",
        caption="Amplitude density by Welch's method." + words,
        height=380,
        folded=order >= OPEN_FIGURES,
    )


def _noise(series: ChannelSeries, frequency: Array) -> list[Spec]:
    """White noise of rms s, sampled at the rate r, has the one-sided amplitude density s sqrt(2 / r)."""
    if not series.noise_floor > 0:
        return []
    level = series.noise_floor / np.sqrt(float(frequency[-1]))
    ends, values = frequency[[0, -1]], np.full(2, level)
    name = "noise floor, if white"
    return [line(ends, values, name=name, colour=palette.NOISE, line={"dash": "dash"})]


def _thinned(frequency: Array, amplitude: Array) -> tuple[Array, Array]:
    """At most `MOST_POINTS` points, evenly spaced in log frequency, the maximum of each interval."""
    if frequency.size <= MOST_POINTS:
        return frequency, amplitude
    edges = np.unique(np.searchsorted(frequency, np.geomspace(frequency[0], frequency[-1], MOST_POINTS)))
    stops = np.append(edges[1:], frequency.size)
    keep = [start + int(np.argmax(amplitude[start:stop])) for start, stop in zip(edges, stops)]
    return frequency[keep], amplitude[keep]


def _logarithmic(values: Array) -> Spec:
    """A logarithmic axis over `values`, at most `MOST_DECADES` below the largest, with labels that fit."""
    usable = values[np.isfinite(values) & (values > 0)]
    top = float(np.log10(usable.max())) if usable.size else 0.0
    low = max(float(np.log10(usable.min())), top - MOST_DECADES) if usable.size else -1.0
    margin = 0.04 * max(top - low, 0.5)
    steps = (1, 2, 5) if top - low < FEW_DECADES else (1,)
    decades = range(int(np.floor(low - margin)), int(np.ceil(top + margin)) + 1)
    ticks = [step * 10.0**decade for decade in decades for step in steps]
    return {
        "type": "log",
        "range": [low - margin, top + margin],
        "tickvals": ticks,
        "ticktext": [f"{tick:g}" for tick in ticks],
    }


def _mark(frequency: float) -> Spec:
    ends = {"x0": frequency, "x1": frequency, "y0": 0, "y1": 1, "yref": "paper"}
    return {"type": "line", **ends, "line": {"dash": "dot", "width": 1}}


def _mark_text(frequency: float, order: int) -> Spec:
    """Labels next to the marks, each lower than the last; plotly needs their logarithm, unlike for shapes."""
    return {
        "text": label(f"{number(frequency)} Hz"),
        "x": float(np.log10(frequency)),
        "y": 1 - 0.08 * (order % 4),
        "yref": "paper",
        "showarrow": False,
        "xanchor": "left",
        "yanchor": "top",
        "font": {"size": 12},
    }
