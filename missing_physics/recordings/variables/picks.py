"""One variable of a file, or the part of it selected by a mapping's entry."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.raw import Raw
from missing_physics.recordings.maps.mapping import Pick, TimeSource
from robot_model import InputError

__all__ = ["one_dimension", "picked", "placed"]

Array = NDArray[np.float64]


def picked(raw: Raw, pick: Pick) -> Array:
    """``scale * variable + offset``, shape (N,) or (); a derivative is not taken yet.

    Raises:
        InputError: no such variable, no numbers in it, or an index out of its range.
    """
    values = placed(raw.numbers(pick.source), pick, f"{pick.source} of {raw.source}")
    if pick.signed_bits is not None:
        span = 2.0**pick.signed_bits
        values = np.where(values >= span / 2, values - span, values)
    return values if (pick.scale, pick.offset) == (1.0, 0.0) else pick.scale * values + pick.offset


def placed(values: NDArray[Any], place: Pick | TimeSource, what: str) -> NDArray[Any]:
    """The selected row, column or index of a variable; all of it if it has one long dimension."""
    if place.reshape is not None:
        values = _reshaped(values, place.reshape, what)
    shape = " x ".join(map(str, values.shape))
    key: tuple[Any, ...] | None = None
    if place.row is not None:
        key = (place.row, slice(None))
    elif place.column is not None:
        key = (slice(None), place.column)
    elif place.index is not None:
        key = tuple(slice(None) if step == ":" else step for step in place.index)
    if key is None:
        return one_dimension(values, what.split(" of ")[0], what.split(" of ", 1)[1])
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


def _reshaped(values: NDArray[Any], shape: tuple[int, ...], what: str) -> NDArray[Any]:
    try:
        return values.reshape(shape)
    except ValueError:
        raise InputError(
            f"{what} has {values.size} numbers, which the mapping's reshape = {list(shape)} does not fit."
        ) from None


def one_dimension(values: NDArray[Any], name: str, source: str) -> NDArray[Any]:
    """Shape (N,), or () for a single number. Raises `InputError` if several dimensions are long."""
    flat = values.reshape(()) if values.size == 1 else values.squeeze()
    if flat.ndim > 1:
        shape = " x ".join(map(str, values.shape))
        raise InputError(
            f"{name} of {source} has the shape {shape}; say in a mapping which row, column or index is meant."
        )
    return flat
