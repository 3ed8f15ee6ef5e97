"""State lanes: where the mismatch was located, and which stretches were held out."""

from __future__ import annotations

import rerun as rr

from missing_physics.diagnosis.result import ChannelSeries, Result
from missing_physics.reporting.decimate import intervals
from missing_physics.reporting.palette import AFTER, HELD_OUT, WINDOW
from missing_physics.reporting.runs import TIMELINE, Run
from missing_physics.reporting.selection import windows_of

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
                _changes(series, windows, inside=MISMATCH, outside=NOTHING),
                {MISMATCH: WINDOW},
            )
    if run.series:
        first = run.series[0]
        held = intervals(first.time, first.held_out)
        _send(
            stream,
            run.path("lanes", "data"),
            _changes(first, held, inside=HELD, outside=FITTED),
            {HELD: HELD_OUT, FITTED: AFTER},
        )


def _changes(
    series: ChannelSeries, spans: tuple[tuple[float, float], ...], *, inside: str, outside: str
) -> dict[float, str]:
    """Instant [s] to the state that begins there; spans may touch or overlap."""
    start = float(series.time[0])
    changes = {start: outside}
    end = -float("inf")
    for low, high in sorted(spans):
        if low > end:
            changes[max(low, start)] = inside
        changes = {t: s for t, s in changes.items() if not max(low, start) < t <= high}
        changes[high] = outside
        end = max(end, high)
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
