"""From the variables of a file to a `Recording`: by a mapping, or by native names."""

from __future__ import annotations

from collections.abc import Mapping as MappingType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.low_pass import before_low_pass
from missing_physics.recordings.mapping import ChannelSource, Mapping, Pick, TimeSource
from missing_physics.recordings.names import is_dotted, is_native, misspelt, quantity_of
from missing_physics.recordings.raw import Raw
from robot_model import InputError, Recording

__all__ = ["MIN_SAMPLES", "constants_of", "from_mapping", "from_native_names", "wants_native"]

#: Fewer samples than this support no statement about dynamics, and no check of them.
MIN_SAMPLES = 50
#: No machine gives a greater value in any unit, and squares of greater ones may overflow.
LARGEST = 1e30

Array = NDArray[np.float64]

#: Quantities of bases and links that are used at the instants of a clock of their own, if it is this many
#: times slower than the recording's; those of joints are needed at every instant.
SPARSE = (
    "strain",
    "tip_deflection",
    "tip_acceleration",
    "attitude",
    "angular_velocity",
    "linear_acceleration",
)
SLOWER = 1.5


def wants_native(name: str) -> bool:
    """The `Want` for files with native names."""
    return name == "time" or is_dotted(name)


def from_native_names(raw: Raw) -> Recording:
    """The recording of a file whose variables have native names (interface: PLACE.QUANTITY[.AXIS]).

    Other columns of numbers with a dotted name are kept as they are; the rest is left out.

    Raises:
        InputError: no `time`, no channel, a nearly native name, and whatever makes the data unusable.
    """
    if "time" not in raw.names:
        raise InputError(
            f"{raw.source} has no variable 'time'; name its columns as native channels (time, "
            f"joint1.position, ...) or give a mapping file with --map (it has {_some(raw.names)})."
        )
    channels: dict[str, Array] = {}
    for name in raw.variables:
        near = misspelt(name)
        if near is not None and near not in raw.names:
            raise InputError(
                f"{raw.source} has a column '{name}', which is no native channel; did you mean '{near}'?"
            )
        if is_native(name) or (is_dotted(name) and raw.variables[name].dtype.kind in "biuf"):
            values = _one_dimension(raw.numbers(name), name, raw.source)
            channels[name] = np.atleast_1d(values)
    time = _instants(raw, TimeSource(source="time"), count=0)
    known = {
        k: {n: v for n, v in d.items() if n in channels}
        for k, d in (("noise", raw.noise), ("res", raw.resolution))
    }
    return _finished(raw, time, channels, noise=known["noise"], resolution=known["res"])


def from_mapping(raw: Raw, mapping: Mapping) -> Recording:
    """The recording that `mapping` makes of the variables.

    A channel's low-pass filter is undone first. A delayed channel, or one with its own instants, is
    interpolated linearly at the recording's instants; one of a base or link whose clock is slower than the
    recording's only at those next to its own instants, the samples in between are missing. Rows for which
    some channel then has no data are cut off at both ends, and so is what lies outside the window.

    Raises:
        InputError: a variable that is not there, a wrong index, lengths that differ, unusable data.
    """
    columns = {name: _column(raw, channel, name) for name, channel in mapping.channels.items()}
    time = _instants(raw, mapping.time, count=max(values.size for values in columns.values()))
    _check_time(raw, time)
    first, last = time[0], time[-1]
    for name, channel in mapping.channels.items():
        own = time if channel.time is None else _instants(raw, channel.time, count=columns[name].size)
        if columns[name].size != own.size:
            raise InputError(
                f"{raw.source} has {columns[name].size} samples for {name} but {own.size} instants; "
                "correct the mapping's row, column or index."
            )
        if channel.low_pass is not None:
            _check_time(raw, own, least=MIN_SAMPLES)
            columns[name] = before_low_pass(own, columns[name], channel.low_pass)
        if channel.delay or channel.time is not None:
            _check_time(raw, own, least=2)
            between = _between(time + channel.delay, own) if quantity_of(name) in SPARSE else False
            columns[name] = np.where(between, np.nan, np.interp(time + channel.delay, own, columns[name]))
            first, last = max(first, own[0] - channel.delay), min(last, own[-1] - channel.delay)
    if mapping.window is not None:
        first, last = max(first, mapping.window[0]), min(last, mapping.window[1])
    keep = slice(int(np.searchsorted(time, first)), int(np.searchsorted(time, last, side="right")))
    if len(time[keep]) < MIN_SAMPLES <= len(time):
        raise InputError(
            f"{raw.source} has {len(time[keep])} of its {len(time)} samples inside the mapping's window and "
            f"where delayed channels and those of own times have values; at least {MIN_SAMPLES} are needed: "
            "correct the window or the delay."
        )
    return _finished(
        raw,
        time[keep],
        {name: values[keep] for name, values in columns.items()},
        noise={n: c.noise for n, c in mapping.channels.items() if c.noise is not None},
        resolution={n: c.resolution for n, c in mapping.channels.items() if c.resolution is not None},
    )


def _between(time: Array, own: Array) -> NDArray[np.bool_] | bool:
    """Instants with none of a slower clock's within half a sample; none where that clock is no slower."""
    step = float(np.median(np.diff(time)))
    if np.median(np.diff(own)) < SLOWER * step:
        return False
    after = np.clip(np.searchsorted(own, time), 1, own.size - 1)
    apart = np.minimum(np.abs(time - own[after - 1]), np.abs(own[after] - time))
    return np.asarray(apart > 0.5 * (1 + 1e-9) * step)


def constants_of(raw: Raw, mapping: Mapping) -> dict[str, float]:
    """The numbers that the mapping's `constants` name. Raises `InputError` when one is not a scalar."""
    found: dict[str, float] = {}
    for name, pick in mapping.constants.items():
        value = _picked(raw, pick)
        if value.size != 1:
            raise InputError(f"{pick.source} of {raw.source} has {value.size} values where one is due.")
        found[name] = float(value.reshape(()))
    return found


def _column(raw: Raw, channel: ChannelSource, name: str) -> Array:
    parts = [_picked(raw, pick) for pick in channel.picks()]
    sizes = {part.size for part in parts if part.ndim}
    if len(sizes) > 1:
        raise InputError(f"the variables of {name} differ in length in {raw.source} ({sorted(sizes)}).")
    total = np.prod(np.broadcast_arrays(*parts), axis=0) if channel.product else sum(parts, np.float64(0))
    values = np.atleast_1d(channel.scale * total + channel.offset)
    if channel.valid is not None:
        on = _one_dimension(raw.numbers(channel.valid), channel.valid, raw.source)
        if on.shape != values.shape:
            raise InputError(f"{channel.valid} of {raw.source} has {on.size} values, {name} {values.size}.")
        values = np.where(on != 0, values, np.nan)
    return np.asarray(values, dtype=np.float64)


def _picked(raw: Raw, pick: Pick) -> Array:
    values = _placed(raw.numbers(pick.source), pick, f"{pick.source} of {raw.source}")
    if pick.signed_bits is not None:
        span = 2.0**pick.signed_bits
        values = np.where(values >= span / 2, values - span, values)
    return values if (pick.scale, pick.offset) == (1.0, 0.0) else pick.scale * values + pick.offset


def _placed(values: NDArray[Any], place: Pick | TimeSource, what: str) -> NDArray[Any]:
    shape = " x ".join(map(str, values.shape))
    key: tuple[Any, ...] | None = None
    if place.row is not None:
        key = (place.row, slice(None))
    elif place.column is not None:
        key = (slice(None), place.column)
    elif place.index is not None:
        key = tuple(slice(None) if step == ":" else step for step in place.index)
    if key is None:
        return _one_dimension(values, what.split(" of ")[0], what.split(" of ", 1)[1])
    if len(key) != values.ndim:
        raise InputError(
            f"{what} has the shape {shape or 'of a scalar'}, to which the mapping's place does not fit."
        )
    try:
        return np.asarray(values[key])
    except IndexError:
        raise InputError(
            f"{what} has the shape {shape}; the mapping's row, column or index lies outside (the first is 0)."
        ) from None


def _one_dimension(values: NDArray[Any], name: str, source: str) -> NDArray[Any]:
    flat = values.reshape(()) if values.size == 1 else values.squeeze()
    if flat.ndim > 1:
        shape = " x ".join(map(str, values.shape))
        raise InputError(
            f"{name} of {source} has the shape {shape}; say in a mapping which row, column or index is meant."
        )
    return flat


def _instants(raw: Raw, time: TimeSource, *, count: int) -> Array:
    """Sample instants [s], shape (N,); `count` is N where only a rate is known."""
    if time.source is None:
        assert time.rate is not None
        return np.arange(count) / time.rate
    values = raw[time.source]
    if values.dtype.kind in "SUO":
        values = _timestamps(raw, time.source)
    values = np.atleast_1d(_placed(values, time, f"{time.source} of {raw.source}"))
    if values.dtype.kind == "M":
        since = (values - values[0]) / np.timedelta64(1, "ns") * 1e-9 if values.size else np.zeros(0)
        return np.asarray(since, dtype=np.float64)
    if time.start_at_zero and values.size:
        values = values - values[0]  # before the conversion: nanoseconds since 1970 exceed a float's 53 bits
    return np.asarray(values, dtype=np.float64) * time.scale


def _timestamps(raw: Raw, name: str) -> NDArray[Any]:
    """Text as instants where it reads as ISO 8601, else as numbers (whose error names the row)."""
    try:
        return np.array([str(value).strip().rstrip("Z") for value in raw[name].flat], dtype="datetime64[ns]")
    except ValueError:
        return raw.numbers(name)


def _check_time(raw: Raw, time: Array, *, least: int = MIN_SAMPLES) -> None:
    """Before `Recording` does it, because here the row of the file is known."""
    if time.size < least:
        raise InputError(
            f"{raw.source} has {time.size} samples; at least {least} are needed, so record longer."
        )
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        row = int(bad[0]) + raw.first_row
        raise InputError(f"{raw.source} has no number for time in row {row}; complete it or remove the row.")
    wrong = np.flatnonzero(np.diff(time) <= 0)
    if wrong.size:
        i = int(wrong[0]) + 1
        kind = "repeats" if time[i] == time[i - 1] else "goes back"
        rows = "one such row" if wrong.size == 1 else f"{wrong.size} such rows"
        raise InputError(
            f"{raw.source}: time {kind} in row {i + raw.first_row} ({float(time[i - 1])} s, then "
            f"{float(time[i])} s; {rows}); sort the rows and remove doubles."
        )


def _finished(
    raw: Raw,
    time: Array,
    channels: MappingType[str, Array],
    *,
    noise: MappingType[str, float],
    resolution: MappingType[str, float],
) -> Recording:
    if not channels:
        raise InputError(f"{raw.source} has no native channel beside time (it has {_some(raw.names)}).")
    _check_time(raw, time)
    for name, values in channels.items():
        if values.size != time.size:
            raise InputError(f"{raw.source} has {values.size} samples for {name} but {time.size} for time.")
        infinite = np.flatnonzero(np.isinf(values))
        if infinite.size:
            raise InputError(
                f"{raw.source} has an infinite value of {name} in row {int(infinite[0]) + raw.first_row}; "
                "correct it, or leave it empty."
            )
        beyond = np.flatnonzero(np.abs(values) > LARGEST)
        if beyond.size:
            row = int(beyond[0])
            raise InputError(
                f"{raw.source} has {values[row]:.3g} for {name} in row {row + raw.first_row}, which no "
                "machine gives; correct it, or its unit."
            )
        if np.isnan(values).all():
            raise InputError(
                f"{raw.source} has no number at all for {name}; remove the column or export it again."
            )
    return Recording(time=time, channels=channels, source=raw.source, noise=noise, resolution=resolution)


def _some(names: tuple[str, ...]) -> str:
    return ", ".join(names[:8]) + (", ..." if len(names) > 8 else "") if names else "none"
