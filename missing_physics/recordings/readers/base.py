"""What the readers share."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_model import InputError

__all__ = ["LONGEST_REASON", "flattened_records", "reading"]

#: Characters of a library's own message that are worth showing.
LONGEST_REASON = 160


@contextmanager
def reading(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever a format library raises on a damaged file into an `InputError`.

    The libraries raise a dozen different types on damaged bytes (among them zlib.error, struct.error,
    KeyError, RecursionError, MemoryError), and none of them documents which; so all are caught here.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:LONGEST_REASON] or type(error).__name__
        raise InputError(
            f"{path} cannot be read as {kind}; it may be truncated or damaged "
            f"({reason.rstrip('.')}); export it again."
        ) from None


def flattened_records(name: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """An array as one variable, or a structured array as one variable per field, at any depth.

    A structure's fields are arrays themselves (MATLAB); of an array of structures with scalar fields
    each field becomes one array of numbers. What is neither is left out.
    """
    if values.dtype.names is None:
        return {name: values}
    found: dict[str, NDArray[Any]] = {}
    for field in values.dtype.names:
        cells = values[field]
        column = _unpacked(cells) if cells.dtype == object else cells
        if column is not None:
            found |= flattened_records(f"{name}.{field}", column)
    return found


def _unpacked(cells: NDArray[Any]) -> NDArray[Any] | None:
    """The content of one cell, or the scalars of many in one array; None for anything else."""
    items = [np.asarray(item) for item in cells.flat]
    if len(items) == 1:
        return items[0]
    if items and all(item.size == 1 and item.dtype.kind in "biuf" for item in items):
        return np.array([item.reshape(())[()] for item in items])
    return None
