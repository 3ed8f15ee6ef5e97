"""Two recordings of one motion, channel by channel: differences as numbers, and side by side in a rerun file.

Entity paths of the rerun file: ``channels/CHANNEL/reference``, ``channels/CHANNEL/exudyn`` and
``difference/CHANNEL``, Exudyn minus reference, over the timeline ``sim_time`` in seconds.
"""

from __future__ import annotations

import os
import uuid
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from missing_physics.reporting import palette
from missing_physics.reporting.decimate import envelope_indices
from robot_model import InputError, Recording, replacing

__all__ = ["Difference", "differences", "write_crosscheck"]

TIMELINE = "sim_time"
#: Samples drawn of all series together, as in `missing_physics.reporting.rerun_file`.
MOST_SAMPLES = 1_600_000
#: Channels with a tab of their own, those that differ most first; the data of all are in the file.
MOST_TABS = 12
#: A range below this part of the largest value, or of 1, is rounding: nothing is relative to it.
FLAT = 1e-12


@dataclass(frozen=True)
class Difference:
    """How far two engines are apart in one channel.

    Attributes:
        channel: native name.
        largest, rms: of the difference, in the channel's unit.
        time: of the largest [s].
        extent: greatest minus least value of the reference, in the channel's unit.
    """

    channel: str
    largest: float
    rms: float
    time: float
    extent: float

    @property
    def relative_largest(self) -> float | None:
        """Largest difference over the channel's range; None of a channel that stays constant."""
        return self.largest / self.extent if self.extent > 0 else None

    @property
    def relative_rms(self) -> float | None:
        """Root mean square over the channel's range; None of a channel that stays constant."""
        return self.rms / self.extent if self.extent > 0 else None


def differences(reference: Recording, other: Recording) -> tuple[Difference, ...]:
    """Of all channels that both have, in the order of the reference.

    Raises:
        InputError: the recordings have different instants.
    """
    if not np.array_equal(reference.time, other.time):
        raise InputError(f"{reference.source} and {other.source} are sampled at different instants.")
    found = []
    for channel in (name for name in reference if name in other):
        first = reference[channel]
        gap = np.abs(other[channel] - first)
        extent, size = float(np.ptp(first)), float(np.abs(first).max())
        worst = int(np.argmax(gap))
        found.append(
            Difference(
                channel,
                float(gap[worst]),
                float(np.sqrt(np.mean(gap**2))),
                float(reference.time[worst]),
                extent if extent > FLAT * max(size, 1.0) else 0.0,
            )
        )
    return tuple(found)


def write_crosscheck(reference: Recording, other: Recording, path: str | os.PathLike[str]) -> None:
    """Write both recordings and their differences to a rerun file, whole or not at all.

    Raises:
        InputError: the folder cannot be written.
    """
    ranked = sorted(differences(reference, other), key=lambda item: -(item.relative_largest or 0.0))
    limit = max(MOST_SAMPLES // max(3 * len(ranked), 1), 100)
    identifier = uuid.uuid5(uuid.NAMESPACE_OID, reference.source + other.source)
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        with replacing(path) as temporary:
            stream = rr.RecordingStream("missing_physics", recording_id=identifier, send_properties=False)
            stream.save(temporary, default_blueprint=_blueprint([item.channel for item in ranked]))
            for item in ranked:
                name = rr.escape_entity_path_part(item.channel)
                first, second = reference[item.channel], other[item.channel]
                lines = (
                    (f"channels/{name}/reference", palette.AFTER_ON_DARK, 3.0, first),
                    (f"channels/{name}/exudyn", palette.BEFORE, 1.2, second),
                    (f"difference/{name}", palette.MEASURED_ON_DARK, 1.2, second - first),
                )
                for where, colour, width, values in lines:
                    _send(stream, where, reference.time, values, colour=colour, width=width, limit=limit)
            stream.flush()
            stream.disconnect()
    finally:
        rr.set_strict_mode(before)


def _send(
    stream: rr.RecordingStream,
    path: str,
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    colour: str,
    width: float,
    limit: int,
) -> None:
    keep = envelope_indices(values, limit)
    red, green, blue = (int(colour[start : start + 2], 16) for start in (1, 3, 5))
    stream.log(path, rr.SeriesLines(colors=(red, green, blue), widths=width), static=True)
    stream.send_columns(
        path,
        indexes=[rr.TimeColumn(TIMELINE, duration=time[keep])],
        columns=rr.Scalars.columns(scalars=values[keep]),
    )


def _blueprint(channels: list[str]) -> rrb.Blueprint:
    linked = rrb.TimeAxis(link="LinkToGlobal")
    tabs = []
    for channel in channels[:MOST_TABS]:
        name = rr.escape_entity_path_part(channel)
        both = rrb.TimeSeriesView(origin=f"/channels/{name}", name=channel, axis_x=linked)
        gap = rrb.TimeSeriesView(origin=f"/difference/{name}", name="Exudyn minus reference", axis_x=linked)
        tabs.append(rrb.Vertical(both, gap, name=channel))
    return rrb.Blueprint(
        rrb.Tabs(*tabs, name="Channels"),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="paused"),
        auto_views=False,
        auto_layout=False,
    )
