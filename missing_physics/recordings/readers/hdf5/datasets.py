"""The datasets of an HDF5 file, read by a separate process; see `program`."""

from __future__ import annotations

import math
from pathlib import Path

from missing_physics.isolation.process import started
from missing_physics.recordings.channels.raw import Raw, Want
from missing_physics.recordings.readers.base import reading
from missing_physics.recordings.readers.objects import closed_objects
from missing_physics.recordings.readers.source import Source

__all__ = ["is_hdf5", "read_datasets"]

_PROGRAM = Path(__file__).with_name("program.py")
#: Signature of HDF5, at byte 0, 512 or that times a power of two.
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_FIRST_DOUBLED = 512
#: Number of copies in memory while numbers are read.
_COPIES = 2


def is_hdf5(source: Source) -> bool:
    """Whether the file is HDF5, regardless of its header text."""
    size = source.path.stat().st_size
    at = 0
    with source.path.open("rb") as file:
        while at < size:
            file.seek(at)
            if file.read(len(_SIGNATURE)) == _SIGNATURE:
                return True
            at = 2 * at or _FIRST_DOUBLED
    return False


def read_datasets(source: Source, *, want: Want, kind: str, by_columns: bool) -> Raw:
    """The datasets of numbers, those in groups with dots.

    Args:
        source: the file.
        want: which to read, by name.
        kind: displayed name of the format.
        by_columns: whether the writer stores by columns, as MATLAB does, so that shapes are reversed.

    Raises:
        InputError: truncated, damaged, or larger than the budget.
    """
    path = str(source.path.resolve())
    with reading(source, kind), started(_PROGRAM, path, library="HDF5's library") as process:
        content = process.read()
        items = {item["name"].replace("/", "."): item for item in content["datasets"]}
        wanted = {label: item for label, item in items.items() if want(label)}
        size = 0
        for label, item in wanted.items():
            shape, entry, chunk = item["shape"], item["entry"], item["chunk"]
            source.budget.take_array(source, label, shape, entry)
            source.budget.take(chunk, f"{source} declares {label} in chunks of {chunk} bytes")
            size += math.prod(shape) * entry + chunk
        process.ask([item["name"] for item in wanted.values()], _COPIES * size)
        found = {label: process.numbers(item) for label, item in wanted.items()}
        if by_columns:
            found = {label: values.T for label, values in found.items()}
        return Raw(source.name, found, tuple(items), objects=closed_objects(content.get("objects", {})))
    raise AssertionError("unreachable: reading() raises")
