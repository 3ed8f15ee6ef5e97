"""Tables in memory: data frames of any kind, datasets of xarray, dictionaries of arrays.

Narwhals supports the data frames (pandas, polars, PyArrow, Modin, DuckDB and more) and requires none of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from missing_physics.recordings.channels.raw import Raw
from missing_physics.recordings.readers.columns import table_variables
from robot_model import InputError

__all__ = ["raw_of"]

#: Name of a data frame's index column that has none.
TIME = "time"
#: Kinds of arrays that variables can have; time spans are turned into seconds.
_KINDS = "biufMmSUO"


def raw_of(data: Any, *, name: str = "data") -> Raw:
    """The variables of a table in memory.

    Args:
        data: a data frame, eager or lazy, that Narwhals knows; a Dataset or DataArray of xarray; a mapping of
            names to arrays, mappings in it with dots; a structured array.
        name: for errors.

    Returns:
        Columns of shape (N,), lists and arrays (N, k); the index of a pandas data frame, unless it is just
        row numbers, by its name, or as ``time``.

    Raises:
        InputError: not a table, no column, or a column without numbers, instants or text.
    """
    if hasattr(data, "coords") and hasattr(data, "dims"):  # a Dataset is a mapping, too
        found = _of_xarray(data, name)
    elif isinstance(data, Mapping):
        found = dict(_flattened("", data, name))
    elif isinstance(data, np.ndarray) and data.dtype.names:
        found = dict(_flattened("", {field: data[field] for field in data.dtype.names}, name))
    else:
        found = _of_frame(data, name)
    if not found:
        raise InputError(f"{name} has no columns; give one with the instants and one for each channel.")
    return Raw(name, found, tuple(found))


def _flattened(prefix: str, data: Mapping[Any, Any], name: str) -> Iterator[tuple[str, NDArray[Any]]]:
    for key, value in data.items():
        label = f"{prefix}.{key}" if prefix else str(key)
        if isinstance(value, Mapping):
            yield from _flattened(label, value, name)
        elif value is not None:
            yield label, _array(value, label, name)


def _array(values: Any, label: str, name: str) -> NDArray[Any]:
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{name} holds something in '{label}' that is no array ({' '.join(str(error).split())[:160]})."
        ) from None
    if array.dtype.kind not in _KINDS:
        raise InputError(
            f"{name} holds {array.dtype} in '{label}', where numbers, instants or text are expected."
        )
    if array.dtype.kind == "m":
        return np.asarray(array / np.timedelta64(1, "ns") * 1e-9)
    return array.astype("datetime64[ns]") if array.dtype.kind == "M" else array


def _of_xarray(data: Any, name: str) -> dict[str, NDArray[Any]]:
    if not hasattr(data, "data_vars"):
        data = data.to_dataset(name=str(data.name or name))
    return {str(key): _array(data[key].values, str(key), name) for key in (*data.coords, *data.data_vars)}


def _of_frame(data: Any, name: str) -> dict[str, NDArray[Any]]:
    import narwhals as nw  # it takes a tenth of a second, and files do not need it

    try:
        frame = nw.from_native(data)
    except TypeError:
        raise InputError(
            f"{name} is of type {type(data).__name__}, which is no table; give a data frame, a Dataset of "
            "xarray or a dictionary of arrays."
        ) from None
    try:
        eager = frame.collect() if isinstance(frame, nw.LazyFrame) else frame
        table = _with_index(eager).to_arrow()
    except (pa.ArrowException, nw.exceptions.NarwhalsError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())[:160].rstrip(".")
        raise InputError(f"{name} holds columns that are no numbers, instants or text ({reason}).") from None
    return table_variables(table, name)


def _with_index(frame: Any) -> Any:
    """The frame with its index as a column, unless it is just row numbers."""
    import narwhals as nw

    index = nw.maybe_get_index(frame)
    if index is None or type(index).__name__ == "RangeIndex":
        return frame
    label = str(getattr(index, "name", None) or TIME)
    if label in frame.columns:
        return frame
    values = nw.new_series(label, np.asarray(index), backend=nw.get_native_namespace(frame))
    return nw.maybe_reset_index(frame).with_columns(values)
