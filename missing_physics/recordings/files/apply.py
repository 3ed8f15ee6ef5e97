"""From the variables of a file to a `Recording`: by a mapping, or by native names."""

from __future__ import annotations

from collections.abc import Mapping as MappingType
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.names import is_dotted, is_native, misspelt, quantity_of
from missing_physics.recordings.channels.raw import Raw
from missing_physics.recordings.files.low_pass import before_low_pass
from missing_physics.recordings.maps.mapping import ChannelSource, Mapping, TimeSource
from missing_physics.recordings.variables import (
    MIN_SAMPLES,
    check_time,
    column,
    instants,
    one_dimension,
    parts,
    picked,
    record_rows,
)
from robot_model import InputError, Recording

__all__ = ["constants_of", "from_mapping", "from_native_names", "wants_native"]

#: Largest value of a sensor in SI units: a double resolves an angle of as many rad to 1e-4 rad only.
LARGEST = 1e12
#: The same for a column whose unit is not known, such as nanoseconds since 1970.
LARGEST_OF_ALL = 1e30
#: Values far below the resolution of any sensor. Fourth powers of smaller numbers underflow, so their ratios
#: are undefined; they are artefacts of simulations, or of misread files.
SMALLEST = 1e-60

#: Most samples lost at the ends without a message.
MOST_UNTOLD = 10

Array = NDArray[np.float64]

#: Quantities of bases and links that are used at the instants of their separate clock, if it is this many
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

    Other numeric columns with a dotted name are kept unchanged; the rest is ignored.

    Raises:
        InputError: no `time`, no channel, a misspelt native name, or unusable data.
    """
    if raw.unnamed:
        raise InputError(f"{raw.source} {raw.unnamed}.")
    if "time" not in raw.names and raw.objects:
        closed, words = next(iter(raw.objects.items()))
        raise InputError(f"{raw.source} has no variable 'time': {closed} is {words}.")
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
            values = one_dimension(raw.numbers(name), name, raw.source)
            channels[name] = np.atleast_1d(values)
    time = instants(raw, TimeSource(source="time"), count=0)
    known = {
        k: {n: v for n, v in d.items() if n in channels}
        for k, d in (("noise", raw.noise), ("res", raw.resolution))
    }
    return _finished(raw, time, channels, noise=known["noise"], resolution=known["res"])


def from_mapping(raw: Raw, mapping: Mapping) -> Recording:
    """The recording that `mapping` makes of the variables; of native names if it has no channels.

    A channel's low-pass filter is inverted first. A delayed channel, or one with its own instants, is
    interpolated linearly at the recording's instants; one of a base or link whose clock is slower than the
    recording's only at those next to its own instants, the samples in between are missing. Rows for which
    some channel then has no data are cut off at both ends, and so is what lies outside the window.

    Raises:
        InputError: a variable that is not there, a wrong index, lengths that differ, unusable data.
    """
    if not mapping.channels:
        named = {name: ChannelSource(source=name) for name in raw.variables if is_native(name)}
        mapping = mapping.model_copy(update={"channels": named})
        if not named:
            raise InputError(
                f"{raw.source} has no native channel, and the map names none; add channels to it (the "
                f"file has {_some(raw.names)})."
            )
    found = {name: parts(raw, channel, name) for name, channel in mapping.channels.items()}
    sizes = {name: max(part.size for part in own) for name, own in found.items()}
    every = instants(raw, mapping.time, count=max(sizes.values()))
    rows = slice(0, every.size)
    if mapping.record is not None:
        rows = record_rows(raw, every, record=mapping.record)
        raw = replace(raw, first_row=raw.first_row + rows.start)
    time = every[rows]
    check_time(raw, time)
    columns: dict[str, Array] = {}
    spans: dict[str, tuple[float, float]] = {}
    for name, channel in mapping.channels.items():
        if channel.time is None:
            own, read = every, rows
        else:
            own = instants(raw, channel.time, count=sizes[name])
            read = slice(0, own.size)
        _check_size(raw, name, samples=sizes[name], of_time=own.size)
        unit = mapping.conversion(name)
        values = column(raw, channel, found[name], unit=unit, time=own[read], rows=read, name=name)
        columns[name], spans[name] = _at(time, own[read], values, channel, raw=raw, name=name)
    first, last = mapping.window or (float(time[0]), float(time[-1]))
    wanted = time[(time >= first) & (time <= last)]
    first = max([first, *(span[0] for span in spans.values())])
    last = min([last, *(span[1] for span in spans.values())])
    keep = _kept(raw, time, first=first, last=last)
    recording = _finished(
        raw,
        time[keep],
        {name: values[keep] for name, values in columns.items()},
        noise={n: c.noise for n, c in mapping.channels.items() if c.noise is not None},
        resolution={n: c.resolution for n, c in mapping.channels.items() if c.resolution is not None},
    )
    return replace(recording, left_out=_ends_words(wanted, recording.time, spans))


def _ends_words(wanted: Array, kept: Array, spans: MappingType[str, tuple[float, float]]) -> str:
    """Message on samples at the ends without values of a delayed channel, or of one with its own instants."""
    if wanted.size - kept.size <= MOST_UNTOLD:
        return ""
    name, (first, last) = min(spans.items(), key=lambda item: item[1][1] - item[1][0])
    return (
        f"{wanted.size - kept.size} of {wanted.size} samples are left out at the ends, where {name} has no "
        f"numbers: it has some from {first:.6g} to {last:.6g} s only"
    )


def _check_size(raw: Raw, name: str, *, samples: int, of_time: int) -> None:
    if samples != of_time:
        raise InputError(
            f"{raw.source} has {samples} samples for {name} but {of_time} instants; "
            "correct the mapping's row, column or index."
        )


def _at(
    time: Array, own: Array, values: Array, channel: ChannelSource, *, raw: Raw, name: str
) -> tuple[Array, tuple[float, float]]:
    """A channel at the recording's instants, with its filter inverted, and its first and last instant.

    Args:
        time: the recording's instants [s], shape (N,).
        own: the channel's own [s], shape (M,).
        values: at these.
        channel: its entry in the mapping.
        raw, name: for errors.
    """
    if channel.low_pass is not None:
        check_time(raw, own)
        values = before_low_pass(own, values, channel.low_pass)
    if not channel.delay and channel.time is None:
        return values, (time[0], time[-1])
    check_time(raw, own, least=2)
    between = _between(time + channel.delay, own) if quantity_of(name) in SPARSE else False
    values = np.where(between, np.nan, np.interp(time + channel.delay, own, values))
    return values, (own[0] - channel.delay, own[-1] - channel.delay)


def _kept(raw: Raw, time: Array, *, first: float, last: float) -> slice:
    keep = slice(int(np.searchsorted(time, first)), int(np.searchsorted(time, last, side="right")))
    if len(time[keep]) < MIN_SAMPLES <= len(time):
        raise InputError(
            f"{raw.source} has {len(time[keep])} of its {len(time)} samples inside the mapping's window and "
            f"where delayed channels and those of own times have values; at least {MIN_SAMPLES} are needed: "
            "correct the window or the delay."
        )
    return keep


def _between(time: Array, own: Array) -> NDArray[np.bool_] | bool:
    """Mask of instants without a sample of a slower clock within half a step; False if it is not slower."""
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
        value = picked(raw, pick)
        if value.size != 1:
            raise InputError(f"{pick.source} of {raw.source} has {value.size} values where one is expected.")
        found[name] = float(value.reshape(()))
    return found


def _finished(
    raw: Raw,
    time: Array,
    channels: MappingType[str, Array],
    *,
    noise: MappingType[str, float],
    resolution: MappingType[str, float],
) -> Recording:
    if not channels:
        raise InputError(f"{raw.source} has no native channel except time (it has {_some(raw.names)}).")
    check_time(raw, time)
    for name, values in channels.items():
        if values.size != time.size:
            raise InputError(f"{raw.source} has {values.size} samples for {name} but {time.size} for time.")
        infinite = np.flatnonzero(np.isinf(values))
        if infinite.size:
            raise InputError(
                f"{raw.source} has an infinite value of {name} in row {int(infinite[0]) + raw.first_row}; "
                "correct it, or leave it empty."
            )
        beyond = np.flatnonzero(np.abs(values) > (LARGEST if is_native(name) else LARGEST_OF_ALL))
        if beyond.size:
            row = int(beyond[0])
            raise InputError(
                f"{raw.source} has {values[row]:.3g} for {name} in row {row + raw.first_row}, which no "
                "machine reaches; correct it or its unit, or leave it empty."
            )
        if np.isnan(values).all():
            raise InputError(
                f"{raw.source} has no number at all for {name}; remove the column or export it again."
            )
    kept = {name: _without_dust(values) for name, values in channels.items()}
    return Recording(time=time, channels=kept, source=raw.source, noise=noise, resolution=resolution)


def _without_dust(values: Array) -> Array:
    dust = (np.abs(values) < SMALLEST) & (values != 0)
    return np.where(dust, 0.0, values) if dust.any() else values


def _some(names: tuple[str, ...]) -> str:
    return ", ".join(names[:8]) + (", ..." if len(names) > 8 else "") if names else "none"
