"""Numbers of one channel from the variables that its entry in a mapping names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.raw import Raw
from missing_physics.recordings.maps.conversion import Conversion
from missing_physics.recordings.maps.mapping import ChannelSource, ServoVoltage
from missing_physics.recordings.variables.instants import check_time
from missing_physics.recordings.variables.picks import one_dimension, picked
from robot_model import InputError

__all__ = ["column", "parts"]

Array = NDArray[np.float64]

#: Samples from which a derivative by central differences can be taken.
DERIVATIVE_SAMPLES = 3


def parts(raw: Raw, channel: ChannelSource, name: str) -> tuple[Array, ...]:
    """The parts of the channel, each of shape (N,), or () for a constant of the file.

    Raises:
        InputError: a variable that is not there, or lengths that differ.
    """
    found = tuple(picked(raw, pick) for pick in channel.picks())
    sizes = {part.size for part in found if part.ndim}
    if len(sizes) > 1:
        raise InputError(f"the variables of {name} differ in length in {raw.source} ({sorted(sizes)}).")
    return found


def column(
    raw: Raw,
    channel: ChannelSource,
    found: Sequence[Array],
    *,
    unit: Conversion,
    time: Array,
    rows: slice,
    name: str,
) -> Array:
    """The channel in its SI unit, shape (N,); NaN where it is not defined.

    Args:
        raw: the file.
        channel: its entry in the mapping.
        found: its parts, all rows of them.
        unit: factor and shift to the SI unit.
        time: instants of the rows that are read [s], shape (N,).
        rows: which rows are read.
        name: of the channel.
    """
    read = [part[rows] if part.ndim else part for part in found]
    for i, pick in enumerate(channel.picks()):
        if pick.derivative:
            read[i] = _derivative(raw, read[i], time, name)
    with np.errstate(over="ignore", invalid="ignore"):  # infinite values are then refused with their row
        total = _total(channel, read)
        values = np.atleast_1d(channel.scale * (unit[0] * total + unit[1]) + channel.offset)
    if channel.clip is not None:
        values = np.clip(values, *channel.clip)
    if channel.valid is not None:
        on = one_dimension(raw.numbers(channel.valid), channel.valid, raw.source)[rows]
        if on.shape != values.shape:
            raise InputError(f"{channel.valid} of {raw.source} has {on.size} values, {name} {values.size}.")
        values = np.where(on != 0, values, np.nan)
    return np.asarray(values, dtype=np.float64)


def _total(channel: ChannelSource, read: Sequence[Array]) -> Array:
    """X of a channel (`ChannelSource`) from its parts."""
    if channel.product:
        return np.asarray(np.prod(np.broadcast_arrays(*read), axis=0))
    if channel.servo is not None:
        return _servo_voltage(channel.servo, *read)
    return np.asarray(sum(read, np.float64(0)))


def _servo_voltage(servo: ServoVoltage, goal: Array, position: Array, *named: Array) -> Array:
    """Voltage from goal and position, shape (N,) [V]; `named` are gain and supply if the file has them."""
    remaining = iter(named)
    gain, supply = (next(remaining) if isinstance(own, str) else own for own in (servo.gain, servo.supply))
    return np.asarray(supply * np.clip(gain * (goal - position), -servo.limit, servo.limit))


def _derivative(raw: Raw, values: Array, time: Array, name: str) -> Array:
    """Derivative of second order in the step, also where steps differ; one-sided at both ends."""
    if not values.ndim:
        raise InputError(f"{name} asks for the derivative of a single number of {raw.source}.")
    check_time(raw, time, least=DERIVATIVE_SAMPLES)
    return np.gradient(values, time, edge_order=2)
