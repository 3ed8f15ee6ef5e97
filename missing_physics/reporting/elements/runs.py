"""The recordings of a result under the short names used in paths of a rerun file."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import rerun as rr

from missing_physics.reporting.elements.selection import channels, short_names
from missing_physics.results.result import ChannelSeries, Result

__all__ = ["TIMELINE", "Run", "runs"]

TIMELINE = "sim_time"


@dataclass(frozen=True)
class Run:
    """One recording.

    Attributes:
        name: as in paths.
        source: displayed name.
        recording: the recording's own source.
        role: whether it was fitted or scored.
        series: with the worst mismatch first.
    """

    name: str
    source: str
    recording: str
    role: str
    series: tuple[ChannelSeries, ...]

    def path(self, *parts: str) -> str:
        """Entity path below this run; every part is escaped."""
        return str(rr.new_entity_path([self.name, *parts]))


def runs(result: Result) -> tuple[Run, ...]:
    """One run per recording and role, in the order of the result; series without samples are skipped.

    Two recordings with the same name are distinguished by a channel that occurs twice.
    """
    rank = {channel: order for order, channel in enumerate(channels(result))}
    names = short_names(result)
    groups: dict[tuple[str, str, int], list[ChannelSeries]] = {}
    seen: Counter[tuple[str, str, str]] = Counter()
    for series in (s for s in result.series if s.time.size):
        key = (series.recording, series.role, series.channel)
        groups.setdefault((series.recording, series.role, seen[key]), []).append(series)
        seen[key] += 1
    return tuple(
        Run(
            f"run{count}",
            names[recording],
            recording,
            role,
            tuple(sorted(group, key=lambda s: rank[s.channel])),
        )
        for count, ((recording, role, _), group) in enumerate(groups.items(), 1)
    )
