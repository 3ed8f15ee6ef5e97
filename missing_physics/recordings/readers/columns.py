"""Arrow columns as NumPy arrays; shared by CSV and Parquet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from missing_physics.recordings.readers.source import Source

__all__ = ["is_read", "is_text", "table_variables"]

#: What a Python string takes beside its characters [bytes].
_STRING = 60

_NUMBERS = (
    pa.types.is_null,
    pa.types.is_boolean,
    pa.types.is_decimal,
    pa.types.is_integer,
    pa.types.is_floating,
    pa.types.is_timestamp,
    pa.types.is_date,
)


def is_text(kind: pa.DataType) -> bool:
    """Whether a column is text, encoded by a dictionary or not."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def is_read(kind: pa.DataType) -> bool:
    """Whether a column of this type becomes a variable: numbers, instants, text, lists of equal length."""
    if pa.types.is_fixed_size_list(kind):
        return any(is_kind(kind.value_type) for is_kind in _NUMBERS)
    return is_text(kind) or any(is_kind(kind) for is_kind in _NUMBERS)


def table_variables(table: pa.Table, source: Source) -> dict[str, NDArray[Any]]:
    """Each column as an array, shape (N,) or (N, k) for lists of equal length; empty cells become NaN.

    Columns of nested or foreign types are left out. Text is taken from the budget of `source` before Python
    has it, everything else must have been.
    """
    found: dict[str, NDArray[Any]] = {}
    for name in table.column_names:
        column = table.column(name)
        if is_text(column.type):
            found[name] = _text(column, name, source)
        elif is_read(column.type):
            found[name] = _array(column)
    return found


def _array(column: pa.ChunkedArray) -> NDArray[Any]:
    kind = column.type
    if pa.types.is_fixed_size_list(kind):
        return np.asarray(column.combine_chunks().flatten().to_numpy(zero_copy_only=False)).reshape(
            len(column), kind.list_size
        )
    if pa.types.is_timestamp(kind) or pa.types.is_date(kind):
        return np.asarray(column.cast(pa.timestamp("ns")).to_numpy())
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    if pa.types.is_boolean(kind) or pa.types.is_decimal(kind):
        return np.asarray(column.cast(pa.float64()).to_numpy())
    return np.asarray(column.to_numpy())


def _text(column: pa.ChunkedArray, name: str, source: Source) -> NDArray[Any]:
    """Text as Python strings, each different one once, and None for an empty cell; shape (N,)."""
    encoded = column if pa.types.is_dictionary(column.type) else column.dictionary_encode()
    chunks = encoded.unify_dictionaries().chunks
    if not chunks:
        return np.empty(0, dtype=object)
    words = chunks[0].dictionary
    size = words.nbytes + _STRING * len(words)
    source.budget.take(size, f"{source} holds {len(words)} different texts in '{name}'")
    strings = np.array([*words.to_pylist(), None], dtype=object)
    empty = len(words)
    places = [chunk.indices.fill_null(empty).to_numpy(zero_copy_only=False) for chunk in chunks]
    return np.asarray(strings[np.concatenate(places)])
