"""Sample instants: from a variable, from time stamps, or from a rate."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.raw import Raw
from missing_physics.recordings.maps.mapping import TimeSource
from missing_physics.recordings.variables.disorder import disorder
from missing_physics.recordings.variables.picks import placed
from robot_model import InputError

__all__ = ["MIN_SAMPLES", "check_time", "instants", "record_rows"]

#: Fewest samples for a statement about dynamics, or for checks.
MIN_SAMPLES = 50
#: Largest time of a clock [s], and smallest step of a recorder [s]; powers of longer times and of rates above
#: a gigahertz may overflow.
LARGEST_TIME = 1e30
SHORTEST_STEP = 1e-9

Array = NDArray[np.float64]


def instants(raw: Raw, time: TimeSource, *, count: int) -> Array:
    """Sample instants [s], shape (N,); `count` is N where only a rate is known."""
    if time.source is None:
        assert time.rate is not None
        return np.arange(count) / time.rate
    values = raw[time.source]
    if values.dtype.kind in "SUO":
        values = _timestamps(raw, time.source)
    values = np.atleast_1d(placed(values, time, f"{time.source} of {raw.source}"))
    if values.dtype.kind == "M":
        since = (values - values[0]) / np.timedelta64(1, "ns") * 1e-9 if values.size else np.zeros(0)
        return _spread(since) if time.equal_stamps == "spread" else np.asarray(since, dtype=np.float64)
    if time.start_at_zero and values.size:
        values = values - values[0]  # before the conversion: nanoseconds since 1970 exceed a float's 53 bits
    seconds = np.asarray(values, dtype=np.float64) * time.step
    return _spread(seconds) if time.equal_stamps == "spread" else seconds


def _spread(stamps: Array) -> Array:
    """Rows with equal stamps spread evenly up to the next stamp; after the last one, at the previous rate.

    A clock that ticks more slowly than rows are written gives each row the previous tick.
    """
    first = np.flatnonzero(np.concatenate([[True], np.diff(stamps) != 0]))
    if first.size < 2 or first.size == stamps.size:
        return stamps
    rows = np.arange(stamps.size, dtype=np.float64)
    pace = (stamps[first[-1]] - stamps[first[-2]]) / (first[-1] - first[-2])
    end = stamps[first[-1]] + pace * (stamps.size - first[-1])
    return np.interp(rows, [*first, stamps.size], [*stamps[first], end])


def _timestamps(raw: Raw, name: str) -> NDArray[Any]:
    """Text as instants if it is ISO 8601, else as numbers (whose error names the row)."""
    try:
        return np.array([str(value).strip().rstrip("Z") for value in raw[name].flat], dtype="datetime64[ns]")
    except ValueError:
        return raw.numbers(name, needed=True)


def record_rows(raw: Raw, time: Array, *, record: int) -> slice:
    """The rows of one of several consecutive records in a file; time starts again with each.

    Args:
        raw: for the error.
        time: instants of all rows [s].
        record: which, the first is 1.

    Raises:
        InputError: there are fewer.
    """
    starts = [0, *(np.flatnonzero(np.diff(time) < 0) + 1), time.size]
    if record >= len(starts):
        raise InputError(
            f"{raw.source} holds {len(starts) - 1} record{'s' if len(starts) > 2 else ''} one after another, "
            f"the mapping asks for record {record}; the first is 1."
        )
    return slice(int(starts[record - 1]), int(starts[record]))


def check_time(raw: Raw, time: Array, *, least: int = MIN_SAMPLES) -> None:
    """Check instants before `Recording` does, because here the row of the file is known.

    Raises:
        InputError: too few instants, or one that is missing, repeats, goes back, or is impossibly large.
    """
    if time.size < least:
        raise InputError(
            f"{raw.source} has {time.size} samples; at least {least} are needed, so record longer."
        )
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        row = int(bad[0]) + raw.first_row
        raise InputError(f"{raw.source} has no number for time in row {row}; complete it or remove the row.")
    beyond = np.flatnonzero(np.abs(time) > LARGEST_TIME)
    if beyond.size:
        i = int(beyond[0])
        raise InputError(
            f"{raw.source} has the time {time[i]:.3g} s in row {i + raw.first_row}, which no clock shows; "
            "correct it, or its unit."
        )
    _check_steps(raw, time)


def _check_steps(raw: Raw, time: Array) -> None:
    steps = np.diff(time)
    if np.any(steps <= 0):
        words = disorder(time, first_row=raw.first_row, shortest=MIN_SAMPLES)
        raise InputError(f"{raw.source}: {words}.")
    short = np.flatnonzero(steps < SHORTEST_STEP)
    if short.size:
        i = int(short[0]) + 1
        raise InputError(
            f"{raw.source}: time rises by {steps[i - 1]:.3g} s to row {i + raw.first_row}, less than any "
            "recorder's step; correct the unit of time."
        )
