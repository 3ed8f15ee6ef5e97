"""Arrow columns as NumPy arrays; shared by CSV and Parquet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from missing_physics.recordings.readers.source import Source
from robot_model import InputError

__all__ = ["is_list", "is_read", "is_text", "table_variables"]

#: Memory of a Python string in addition to its characters [bytes].
_STRING = 60

_NUMBERS = (
    pa.types.is_null,
    pa.types.is_boolean,
    pa.types.is_decimal,
    pa.types.is_integer,
    pa.types.is_floating,
    pa.types.is_timestamp,
    pa.types.is_duration,
    pa.types.is_date,
)


def is_text(kind: pa.DataType) -> bool:
    """Whether a column is text, encoded by a dictionary or not."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def is_list(kind: pa.DataType) -> bool:
    """Whether every row of a column is a list."""
    return bool(pa.types.is_fixed_size_list(kind) or pa.types.is_list(kind) or pa.types.is_large_list(kind))


def is_read(kind: pa.DataType) -> bool:
    """Whether a column of this type becomes a variable: numbers, instants, text, lists of equal length."""
    if is_list(kind):
        return any(is_kind(kind.value_type) for is_kind in _NUMBERS)
    return is_text(kind) or any(is_kind(kind) for is_kind in _NUMBERS)


def table_variables(table: pa.Table, source: Source | str) -> dict[str, NDArray[Any]]:
    """Each column as an array, shape (N,) or (N, k) for lists of equal length; empty cells become NaN.

    Time spans become seconds. Columns of nested or foreign types are skipped. Text is taken from the budget
    of `source`, if that is a file, before conversion; everything else must have been taken already.
    """
    found: dict[str, NDArray[Any]] = {}
    for name in table.column_names:
        column = table.column(name)
        if is_text(column.type):
            found[name] = _text(column, name, source)
        elif is_read(column.type):
            found[name] = _lists(column, name, source) if is_list(column.type) else _array(column)
    return found


def _array(column: pa.ChunkedArray) -> NDArray[Any]:
    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_date(kind):
        return np.asarray(column.cast(pa.timestamp("ns")).to_numpy())
    if pa.types.is_duration(kind):
        spans = column.cast(pa.duration("ns")).cast(pa.int64()).cast(pa.float64(), safe=False)
        return np.asarray(spans.to_numpy()) * 1e-9
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    if pa.types.is_boolean(kind) or pa.types.is_decimal(kind):
        return np.asarray(column.cast(pa.float64()).to_numpy())
    return np.asarray(column.to_numpy())


def _lists(column: pa.ChunkedArray, name: str, source: object) -> NDArray[Any]:
    """Lists of numbers, shape (N, k); a row without one is NaN throughout."""
    lengths = pc.list_value_length(column)
    known = pc.unique(lengths.drop_null()).to_pylist()
    if len(known) > 1:
        row = int(np.flatnonzero(lengths.fill_null(known[0]).to_numpy() != known[0])[0])
        raise InputError(
            f"{source} has lists of different lengths in '{name}', of {known[0]} numbers first and of "
            f"{lengths[row].as_py()} in row {row + 1}; give every sample the same."
        )
    entries = column.combine_chunks().filter(column.is_valid().combine_chunks()).flatten()
    rows = np.asarray(_array(pa.chunked_array([entries])))
    size = known[0] if known else 0
    if not column.null_count:
        return rows.reshape(len(column), size)
    found = np.full((len(column), size), np.nan)
    found[column.is_valid().to_numpy()] = rows.reshape(-1, size)
    return found


def _text(column: pa.ChunkedArray, name: str, source: Source | str) -> NDArray[Any]:
    """Text as Python strings, equal ones shared, and None for an empty cell; shape (N,)."""
    encoded = column if pa.types.is_dictionary(column.type) else column.dictionary_encode()
    chunks = encoded.unify_dictionaries().chunks
    if not chunks:
        return np.empty(0, dtype=object)
    words = chunks[0].dictionary
    if isinstance(source, Source):
        size = words.nbytes + _STRING * len(words)
        source.budget.take(size, f"{source} holds {len(words)} different texts in '{name}'")
    strings = np.array([*words.to_pylist(), None], dtype=object)
    empty = len(words)
    places = [chunk.indices.fill_null(empty).to_numpy(zero_copy_only=False) for chunk in chunks]
    return np.asarray(strings[np.concatenate(places)])
