"""Which channels a report draws first, and how many of them."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from missing_physics.results.result import ChannelSeries, Mismatch, Result

__all__ = [
    "MOST_CHANNELS",
    "MOST_SERIES",
    "channels",
    "drawn_series",
    "mismatch_of",
    "residuals",
    "short_names",
    "windows_of",
]

#: Most pictures of a report, for readability and size.
MOST_SERIES = 24
MOST_CHANNELS = 12

Array = NDArray[np.float64]


def short_names(result: Result) -> Mapping[str, str]:
    """Each recording's file name without the folder, or its full name if two would be equal."""
    used = (
        *result.diagnosis.recordings,
        *result.diagnosis.validation,
        *(s.recording for s in result.series),
    )
    full = tuple(dict.fromkeys(used))
    ends = [re.split(r"[/\\]", name.rstrip("/\\"))[-1] for name in full]
    return {name: end if end and ends.count(end) == 1 else name for name, end in zip(full, ends)}


def mismatch_of(result: Result, channel: str) -> Mismatch | None:
    """The mismatch found in a channel, if any."""
    return next((m for m in result.diagnosis.mismatch if m.channel == channel), None)


def channels(result: Result) -> tuple[str, ...]:
    """All channels with series, the one with the largest share of the mismatch first."""

    def share(channel: str) -> float:
        found = mismatch_of(result, channel)
        return found.share if found else 0.0

    names = dict.fromkeys(item.channel for item in result.series)
    return tuple(sorted(names, key=lambda name: -share(name)))


def drawn_series(result: Result) -> tuple[ChannelSeries, ...]:
    """The series that are drawn against time: channels by their share of the mismatch, at most
    `MOST_SERIES`, and for every channel first one recording that was fitted and one that was not."""
    ranked: list[tuple[int, int, ChannelSeries]] = []
    for order, channel in enumerate(channels(result)):
        items = [item for item in result.series if item.channel == channel]
        first = {role: next((s for s in items if s.role == role), None) for role in ("train", "validation")}
        ranked += [(0 if any(s is f for f in first.values()) else 1, order, s) for s in items]
    ranked.sort(key=lambda entry: entry[0])
    kept = ranked[:MOST_SERIES]
    return tuple(series for _, _, series in sorted(kept, key=lambda entry: entry[1]))


def windows_of(result: Result, series: ChannelSeries) -> tuple[tuple[float, float], ...]:
    """Located windows [s] that belong to this series: those of its channel, in the first recording.

    Windows are located in the first fitted recording; the same times have no meaning in another one.
    """
    found = mismatch_of(result, series.channel)
    first = next((s for s in result.series if s.channel == series.channel and s.role == "train"), None)
    return found.windows if found and (first is None or first is series) else ()


def residuals(series: ChannelSeries) -> tuple[Array, Array]:
    """Measured minus nominal and measured minus augmented model, in the channel's unit, shape (N,) each."""
    return series.measured - series.nominal, series.measured - series.augmented
