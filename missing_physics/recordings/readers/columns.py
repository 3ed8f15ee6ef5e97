"""Arrow columns as NumPy arrays; shared by CSV and Parquet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

__all__ = ["table_variables"]


def table_variables(table: pa.Table) -> dict[str, NDArray[Any]]:
    """Each column as an array, shape (N,) or (N, k) for lists of equal length; empty cells become NaN.

    Columns of nested or foreign types are left out.
    """
    found: dict[str, NDArray[Any]] = {}
    for name in table.column_names:
        values = _array(table.column(name))
        if values is not None:
            found[name] = values
    return found


def _array(column: pa.ChunkedArray) -> NDArray[Any] | None:
    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_date(kind):
        return np.asarray(column.cast(pa.timestamp("ns")).to_numpy())
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    if pa.types.is_boolean(kind) or pa.types.is_decimal(kind):
        return np.asarray(column.cast(pa.float64()).to_numpy())
    if pa.types.is_integer(kind) or pa.types.is_floating(kind):
        return np.asarray(column.to_numpy())
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        return np.asarray(column.to_numpy(), dtype=object)
    if pa.types.is_fixed_size_list(kind):
        return np.asarray(column.combine_chunks().flatten().to_numpy(zero_copy_only=False)).reshape(
            len(column), kind.list_size
        )
    return None
