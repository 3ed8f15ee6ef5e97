"""The rerun file of a crosscheck: both engines side by side over time, with their differences.

Entity paths, with ``ENGINE`` = ``reference`` or ``exudyn`` and ``CHANNEL`` a native name (escaped where rerun
asks for it); docs/crosscheck.md shows the same table:

==================================== ===================================================================
``summary``                          the worst channel, the verdict and how to read the file, static
``channels/CHANNEL/ENGINE``          the engine's values, in the channel's unit
``difference/CHANNEL``               Exudyn minus reference
``difference/CHANNEL/band/below``,   what the engines err by themselves, where it was estimated
``difference/CHANNEL/band/above``
``friction/JOINT/ENGINE``            states ``sticks``, ``slips forwards``, ``slips backwards``
``robot/ENGINE/BODY``                moving frames of the bodies, boxes and lines
``robot/ENGINE/LINK/bent``, ``tip``  a flexible link as drawn, its deflection magnified as the view says
==================================== ===================================================================

The only timeline is ``sim_time``, in seconds. All series together have at most `MOST_SAMPLES` samples: longer
ones are reduced to minimum and maximum of each stretch, which preserves the largest differences and is
mentioned in the summary. Everything is written in columns, one chunk for each series.
"""

from __future__ import annotations

import os
import uuid

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from missing_physics.reporting.crosscheck.blueprint import blueprint
from missing_physics.reporting.crosscheck.comparison import Comparison
from missing_physics.reporting.crosscheck.lanes import send_friction
from missing_physics.reporting.crosscheck.paths import (
    TIMELINE,
    bound_paths,
    colour,
    difference_path,
    value_path,
)
from missing_physics.reporting.crosscheck.scene import scene, send_scene
from missing_physics.reporting.crosscheck.summary import markdown
from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.decimate import envelope_indices
from missing_physics.reporting.viewer.file import in_memory, strict
from robot_model import Robot, write_atomically

__all__ = ["MOST_SAMPLES", "samples_per_series", "write_crosscheck"]

#: At 25 bytes each (time, value and row number) about 30 MB; the poses take up to 12 MB more.
MOST_SAMPLES = 1_200_000
#: Lines of a channel: two engines, their difference, two edges of the band.
LINES = 5
#: Least number of samples of a reduced series.
FEWEST = 100

Array = NDArray[np.float64]


def samples_per_series(comparison: Comparison) -> int:
    """Largest number of samples per series; longer recordings are reduced."""
    return max(MOST_SAMPLES // max(LINES * len(comparison.differences), 1), FEWEST)


def write_crosscheck(robot: Robot, comparison: Comparison, path: str | os.PathLike[str]) -> None:
    """Write `comparison` for `robot` to a rerun file (see the module's docstring), atomically.

    Raises:
        InputError: the folder cannot be written.
    """
    engines = {"reference": comparison.reference, "exudyn": comparison.exudyn}
    drawn = scene(robot, engines)
    limit = samples_per_series(comparison)
    thinned = limit if len(comparison.reference) > limit else None
    named = comparison.reference.source + comparison.exudyn.source
    with strict():
        stream = rr.RecordingStream(
            "missing_physics_crosscheck",
            recording_id=uuid.uuid5(uuid.NAMESPACE_OID, named),
            send_properties=False,
        )
        memory = in_memory(stream, blueprint(robot, comparison, drawn))
        text = markdown(robot, comparison, drawn, thinned_to=thinned)
        stream.log("summary", rr.TextDocument(text, media_type="text/markdown"), static=True)
        for item in comparison.differences:
            _send_channel(stream, comparison, item.channel, limit)
        for engine, recording in engines.items():
            send_friction(stream, robot, recording, engine)
        send_scene(stream, robot, drawn)
        content = memory.drain_as_bytes()
        stream.disconnect()
    write_atomically(path, content)


def _send_channel(stream: rr.RecordingStream, comparison: Comparison, channel: str, limit: int) -> None:
    time = comparison.reference.time
    # rerun draws in the order of the paths, so the thin reference is on top of Exudyn.
    for engine, width in (("reference", 1.5), ("exudyn", 4.0)):
        values = (comparison.reference if engine == "reference" else comparison.exudyn)[channel]
        look = rr.SeriesLines(colors=colour(channel, engine), names=f"{engine} {channel}", widths=width)
        _send(stream, value_path(channel, engine), time, values, look, limit)
    gap = comparison.difference(channel)
    look = rr.SeriesLines(colors=colour(channel, "difference"), names=f"difference {channel}", widths=1.2)
    _send(stream, difference_path(channel), time, gap, look, limit)
    band = comparison.bands.get(channel)
    if band is not None:
        for path, sign, edge in zip(bound_paths(channel), (-1.0, 1.0), ("below", "above")):
            shade = tuple(int(palette.WINDOW[k : k + 2], 16) for k in (1, 3, 5))
            look = rr.SeriesLines(colors=shade, names=f"step error, {edge}", widths=1.0)
            _send(stream, path, time, sign * band, look, limit)


def _send(
    stream: rr.RecordingStream, path: str, time: Array, values: Array, look: rr.SeriesLines, limit: int
) -> None:
    keep = envelope_indices(values, limit)
    stream.log(path, look, static=True)
    stream.send_columns(
        path,
        indexes=[rr.TimeColumn(TIMELINE, duration=time[keep])],
        columns=rr.Scalars.columns(scalars=values[keep]),
    )
