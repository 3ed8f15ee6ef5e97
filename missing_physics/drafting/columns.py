"""Columns of a log: all numeric series with the most frequent length."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings import Raw
from robot_model import InputError

__all__ = ["Column", "columns_of"]

#: Maximum number of columns, since some logs have thousands.
MOST = 600
#: Minimum number of samples of a log.
FEWEST = 50

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        source: its variable.
        values: shape (N,); time stamps in nanoseconds since 1970.
        place: row or column of the variable, as in a map.
        number: its index and the variable's number of columns; None if it has only one.
        instants: whether the file declares the values as time stamps.
    """

    source: str
    values: Array = field(repr=False)
    place: dict[str, int] = field(default_factory=dict)
    number: tuple[int, int] | None = None
    instants: bool = False

    @property
    def label(self) -> str:
        """Name of the column in messages."""
        return self.source + (f", {next(iter(self.place))} {self.number[0]}" if self.number else "")


def columns_of(raw: Raw) -> list[Column]:
    """The columns of the log's most frequent length.

    Raises:
        InputError: there are none, or too many.
    """
    arrays = {
        name: values
        for name, raw_values in raw.variables.items()
        if (values := _numbers(raw_values)) is not None
    }
    lengths = Counter(max(values.shape) for values in arrays.values() if max(values.shape) >= FEWEST)
    if not lengths:
        raise InputError(f"{raw.source} has no column of at least {FEWEST} numbers; give a longer recording.")
    length = max(lengths, key=lambda size: (lengths[size], size))
    found: list[Column] = []
    for name, values in arrays.items():
        found += _split(name, values, length, instants=raw.variables[name].dtype.kind == "M")
        if len(found) > MOST:
            raise InputError(
                f"{raw.source} has more than {MOST} columns, too many to guess at; export those of joints."
            )
    return found


def _numbers(values: NDArray[Any]) -> NDArray[Any] | None:
    """Numbers in one or two dimensions; None for anything else."""
    flat = values.squeeze() if values.ndim > 1 else values
    if flat.ndim not in (1, 2) or not flat.size:
        return None
    if flat.dtype.kind in "biuf":
        return np.asarray(flat, dtype=np.float64)
    if flat.dtype.kind == "M" and flat.ndim == 1:
        return np.asarray(flat.astype("datetime64[ns]").astype(np.int64), dtype=np.float64)
    return None


def _split(name: str, values: NDArray[Any], length: int, *, instants: bool) -> Iterator[Column]:
    if values.shape == (length,):
        yield Column(name, values, instants=instants)
    elif values.ndim == 2 and length in values.shape:
        by_rows = values.shape[1] == length
        table = values if by_rows else values.T
        for k, row in enumerate(table[: MOST + 1]):
            yield Column(name, row, {"row" if by_rows else "column": k}, (k, len(table)))
