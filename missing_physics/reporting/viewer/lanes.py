"""State lanes: where the mismatch was located, and which stretches were held out."""

from __future__ import annotations

import numpy as np
import rerun as rr

from missing_physics.reporting.elements.palette import AFTER, HELD_OUT, WINDOW
from missing_physics.reporting.elements.runs import TIMELINE, Run
from missing_physics.reporting.elements.selection import windows_of
from missing_physics.results.result import ChannelSeries, Result

__all__ = ["send_lanes"]

MISMATCH, HELD, FITTED = "mismatch", "held out", "fitted"
#: rerun draws a gap for an empty state.
NOTHING = ""


def send_lanes(stream: rr.RecordingStream, run: Run, result: Result) -> None:
    """One lane per channel with located windows, and one for fitted and held-out stretches."""
    for series in run.series:
        windows = windows_of(result, series)
        if windows:
            _send(
                stream,
                run.path("lanes", "windows", series.channel),
                _windows(series, windows),
                {MISMATCH: WINDOW},
            )
    if run.series:
        _send(stream, run.path("lanes", "data"), _data(run.series[0]), {HELD: HELD_OUT, FITTED: AFTER})


def _data(series: ChannelSeries) -> dict[float, str]:
    """Instant [s] to the use of the data from there on."""
    held = series.held_out
    starts = np.flatnonzero(np.concatenate(([True], held[1:] != held[:-1])))
    return {float(series.time[start]): HELD if held[start] else FITTED for start in starts}


def _windows(series: ChannelSeries, spans: tuple[tuple[float, float], ...]) -> dict[float, str]:
    """Instant [s] to the state that begins there; spans may be unsorted, touch or overlap."""
    start, stop = float(series.time[0]), float(series.time[-1])
    merged: list[list[float]] = []
    for low, high in sorted((max(low, start), min(high, stop)) for low, high in spans):
        if merged and low <= merged[-1][1]:
            merged[-1][1] = max(merged[-1][1], high)
        elif low < high:
            merged.append([low, high])
    changes = {start: NOTHING}
    for low, high in merged:
        changes |= {low: MISMATCH, high: NOTHING}
    return changes


def _send(stream: rr.RecordingStream, path: str, changes: dict[float, str], colours: dict[str, str]) -> None:
    values = list(colours)
    stream.log(
        path,
        rr.StateConfiguration(
            values=values, labels=values, colors=[int(colours[v][1:] + "FF", 16) for v in values]
        ),
        static=True,
    )
    times = sorted(changes)
    stream.send_columns(
        path,
        indexes=[rr.TimeColumn(TIMELINE, duration=times)],
        columns=rr.StateChange.columns(state=[changes[t] for t in times]),
    )
