"""The recordings of a result under the short names that paths of a rerun file are made of."""

from __future__ import annotations

from dataclasses import dataclass

import rerun as rr

from missing_physics.diagnosis.result import ChannelSeries, Result
from missing_physics.reporting.selection import channels

__all__ = ["TIMELINE", "Run", "runs"]

TIMELINE = "sim_time"


@dataclass(frozen=True)
class Run:
    """One recording: `name` as in paths, `source` for people, its series with the worst mismatch first."""

    name: str
    source: str
    role: str
    series: tuple[ChannelSeries, ...]

    def path(self, *parts: str) -> str:
        """Entity path below this run; every part is escaped."""
        return str(rr.new_entity_path([self.name, *parts]))


def runs(result: Result) -> tuple[Run, ...]:
    """One run per recording and role, in the order of the result."""
    order = {channel: rank for rank, channel in enumerate(channels(result))}
    keys = dict.fromkeys((series.recording, series.role) for series in result.series)
    return tuple(
        Run(
            name=f"run{count}",
            source=recording,
            role=role,
            series=tuple(
                sorted(
                    (s for s in result.series if (s.recording, s.role) == (recording, role)),
                    key=lambda s: order[s.channel],
                )
            ),
        )
        for count, (recording, role) in enumerate(keys, 1)
    )
