"""The rerun file `comparison.rrd`: recorded, nominal and augmented, side by side over time.

Entity paths, with ``RUN`` = ``run1``, ``run2``, ... for the recordings in the order of the diagnosis, and
``CHANNEL`` a native name such as ``joint1.torque`` (escaped where rerun asks for it):

================================  ====================================================================
``summary``                       the verdict in words, static Markdown
``RUN/channels/CHANNEL/recorded`` what was measured, in the channel's unit
``RUN/channels/CHANNEL/nominal``  the nominal model
``RUN/channels/CHANNEL/augmented`` the augmented model
``RUN/residuals/CHANNEL/before``  recorded minus nominal
``RUN/residuals/CHANNEL/after``   recorded minus augmented
``RUN/lanes/windows/CHANNEL``     state ``mismatch`` inside the located windows, none outside
``RUN/lanes/data``                state ``held out`` where a sample was not fitted, else ``fitted``
``RUN/robot/BODY``                moving frames of the bodies, boxes and lines (a joint's position known)
``RUN/robot/LINK/bent``, ``tip``  a flexible link as drawn, its deflection magnified as the view says
``unnamed/CHANNEL/curve1``        the measured curve of a force without a name, static: its knots, values and
                                  95 % interval; ``value``, ``low``, ``high`` as lines in a frame
================================  ====================================================================

The only timeline is ``sim_time``, in seconds of the recording. All series together have at most
`MOST_SAMPLES` samples: longer ones are reduced to minimum and maximum of each stretch, which preserves spikes
and is mentioned in the file's summary. The robot is drawn at most `MOST_POSES` times per recording, evenly
spaced. A free base whose attitude was not recorded is drawn at its initial pose, a flexible link without a
recorded deflection straight.
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.decimate import envelope_indices
from missing_physics.reporting.elements.runs import TIMELINE, Run, runs
from missing_physics.reporting.elements.selection import residuals
from missing_physics.reporting.scene.motion import motion, send_motion
from missing_physics.reporting.viewer.blueprint import blueprint
from missing_physics.reporting.viewer.curves import curve_views, send_curves
from missing_physics.reporting.viewer.lanes import send_lanes
from missing_physics.reporting.viewer.summary_text import markdown
from missing_physics.results.result import ChannelSeries, Result
from robot_model import Recording, Robot, write_atomically

__all__ = ["MOST_SAMPLES", "in_memory", "strict", "write_rerun"]

APPLICATION = "missing_physics"
#: At 25 bytes each (time, value and row number) about 40 MB.
MOST_SAMPLES = 1_600_000
LINES_PER_SERIES = 5


def write_rerun(
    result: Result,
    robot: Robot,
    path: str | os.PathLike[str],
    *,
    recordings: Sequence[Recording] = (),
) -> None:
    """Write `result` for the nominal `robot` to `path` (see the module's docstring), atomically.

    Args:
        recordings: the diagnosed recordings, if available: the robot is drawn with their base motion and
            deflections.

    Raises:
        InputError: the folder cannot be written.
    """
    taken = runs(result)
    limit = max(MOST_SAMPLES // max(LINES_PER_SERIES * len(result.series), 1), 100)
    with strict():
        stream = rr.RecordingStream(APPLICATION, recording_id=_identifier(result), send_properties=False)
        by_source = {recording.source: recording for recording in recordings}
        unnamed = result.diagnosis.unnamed
        motions = {run.name: motion(run, robot, by_source.get(run.recording)) for run in taken}
        memory = in_memory(stream, blueprint(taken, motions, curve_views(unnamed, robot)))
        thinned = any(series.time.size > limit for series in result.series)
        stream.log(
            "summary",
            rr.TextDocument(
                markdown(result, thinned_to=limit if thinned else None), media_type="text/markdown"
            ),
            static=True,
        )
        send_curves(stream, unnamed, robot)
        for run in taken:
            for series in run.series:
                _send_series(stream, run, series, limit)
            send_lanes(stream, run, result)
            send_motion(stream, run, robot, motions[run.name])
        content = memory.drain_as_bytes()
        stream.disconnect()
    write_atomically(path, content)


def in_memory(stream: rr.RecordingStream, look: rrb.Blueprint) -> rr.MemoryRecording:
    """Memory sink of what is sent to the stream from now on, with this blueprint.

    rerun's file writer hangs on a full disk (0.41), and does not report why it fails.
    """
    memory = stream.memory_recording()
    rr.send_blueprint(look, make_active=False, make_default=True, recording=stream)
    return memory


@contextmanager
def strict() -> Iterator[None]:
    """rerun's errors as exceptions: by default it only warns and skips what it could not write."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def _identifier(result: Result) -> str:
    """The same diagnosis gives the same recording, so that a viewer replaces it instead of adding one."""
    return str(uuid.uuid5(uuid.NAMESPACE_OID, result.diagnosis.to_json()))


def _send_series(stream: rr.RecordingStream, run: Run, series: ChannelSeries, limit: int) -> None:
    before, after = residuals(series)
    # rerun draws in the order of the paths, so the thin `recorded` is on top of `augmented`.
    lines: Sequence[tuple[str, str, str, float, NDArray[np.float64]]] = (
        ("channels", "recorded", palette.MEASURED_ON_DARK, 1.0, series.measured),
        ("channels", "nominal", palette.BEFORE, 1.2, series.nominal),
        ("channels", "augmented", palette.AFTER_ON_DARK, 3.0, series.augmented),
        ("residuals", "before", palette.BEFORE, 1.2, before),
        ("residuals", "after", palette.AFTER_ON_DARK, 1.5, after),
    )
    for group, which, colour, width, values in lines:
        path = run.path(group, series.channel, which)
        keep = envelope_indices(values, limit)
        stream.log(
            path,
            rr.SeriesLines(colors=_rgb(colour), names=f"{which} [{series.unit}]", widths=width),
            static=True,
        )
        stream.send_columns(
            path,
            indexes=[rr.TimeColumn(TIMELINE, duration=series.time[keep])],
            columns=rr.Scalars.columns(scalars=values[keep]),
        )


def _rgb(colour: str) -> tuple[int, int, int]:
    red, green, blue = (int(colour[start : start + 2], 16) for start in (1, 3, 5))
    return red, green, blue
