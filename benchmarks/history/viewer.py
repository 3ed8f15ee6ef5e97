"""The history of the benchmarks as a file for the rerun viewer: the ratio to every peer over the runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from benchmarks.history.rows import Row
from missing_physics.reporting.elements.palette import AFTER, BEFORE, FORWARDS, WINDOW

__all__ = ["TIMELINE", "entity", "write_history"]

#: The runs, counted from one; the description of each run is in `runs`.
TIMELINE = "run"
COLOURS = tuple(
    tuple(int(colour[k : k + 2], 16) for k in (1, 3, 5)) for colour in (AFTER, BEFORE, FORWARDS, WINDOW)
)


def entity(name: str) -> str:
    """Path of a ratio: its group and its peer."""
    group, peer = name.rsplit(": ", 1)
    return rr.escape_entity_path_part(group) + "/" + rr.escape_entity_path_part(peer)


def write_history(rows: Sequence[Row], path: Path) -> None:
    """Write `path`; the rows as points on the timeline `run`, a view for each group."""
    groups: dict[str, list[str]] = {}
    for name in sorted({name for row in rows for name in row.ratios}):
        groups.setdefault(name.rsplit(": ", 1)[0], []).append(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    with rr.RecordingStream("missing_physics_benchmarks", recording_id="history") as stream:
        stream.save(str(path), default_blueprint=_blueprint(groups))
        for names in groups.values():
            for k, name in enumerate(names):
                _send(stream, rows, name, COLOURS[k % len(COLOURS)])
        for number, row in enumerate(rows, start=1):
            stream.set_time(TIMELINE, sequence=number)
            stream.log("runs", rr.TextLog(f"{row.time} {row.commit or 'no commit'} on {row.machine}"))


def _send(stream: rr.RecordingStream, rows: Sequence[Row], name: str, colour: tuple[int, ...]) -> None:
    kept = [k for k, row in enumerate(rows, start=1) if name in row.ratios]
    look = rr.SeriesLines(colors=colour, names=name.rsplit(": ", 1)[1])
    stream.log(entity(name), look, rr.SeriesPoints(colors=colour, marker_sizes=4), static=True)
    values = np.array([rows[k - 1].ratios[name] for k in kept])
    stream.send_columns(
        entity(name),
        indexes=[rr.TimeColumn(TIMELINE, sequence=kept)],
        columns=rr.Scalars.columns(scalars=values),
    )


def _blueprint(groups: dict[str, list[str]]) -> rrb.Blueprint:
    views = [
        rrb.TimeSeriesView(origin=entity(names[0]).rsplit("/", 1)[0], name=f"{group}: times as fast")
        for group, names in groups.items()
    ]
    log = rrb.TextLogView(origin="runs", name="runs")
    return rrb.Blueprint(rrb.Vertical(rrb.Grid(*views), log, row_shares=[4, 1]), auto_views=False)
