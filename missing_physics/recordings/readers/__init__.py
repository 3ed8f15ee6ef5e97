"""One reader per format, chosen by the file's suffix.

A reader is a module with ``SUFFIXES`` and ``read(source, *, want) -> Raw``. It takes the declared size of a
variable from ``source.budget`` before reading it. A new format is a new file and one line here.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from types import MappingProxyType, ModuleType

from missing_physics.recordings.channels.raw import Raw, Want, everything
from missing_physics.recordings.readers import bags, csv_table, hdf5, json_samples, mat, npz, parquet
from missing_physics.recordings.readers.budget import SIZE_LIMIT, Budget
from missing_physics.recordings.readers.source import Source, opened
from robot_model import InputError

__all__ = ["READERS", "SIZE_LIMIT", "Budget", "read_raw"]

_MODULES: tuple[ModuleType, ...] = (csv_table, parquet, mat, npz, json_samples, hdf5, bags)

#: Suffix (lower case, with its dot) to the module that reads it.
READERS: Mapping[str, ModuleType] = MappingProxyType(
    {suffix: module for module in _MODULES for suffix in module.SUFFIXES}
)

#: First bytes of the formats, and their suffix; all other files are text.
_BEGINS = {
    b"PAR1": ".parquet",
    b"PK\x03\x04": ".npz",
    b"MATLAB ": ".mat",
    b"\x89HDF\r\n\x1a\n": ".h5",
    b"#ROSBAG": ".bag",
    b"\x89MCAP0\r\n": ".mcap",
    b"SQLite format 3\0": ".db3",
    b"{": ".json",
    b"[": ".json",
}
_HEAD = max(map(len, _BEGINS))

#: Similarity from which a suffix counts as a misspelt known one.
ALIKE = 0.7


def read_raw(
    path: str | os.PathLike[str],
    *,
    want: Want = everything,
    skip_lines: int = 0,
    budget: Budget | None = None,
) -> Raw:
    """The variables of a file.

    Args:
        path: the file; its suffix determines the format, or its first bytes if it has none. A pipe without a
            suffix, such as /dev/stdin, is read as CSV.
        want: which variables to read, by name.
        skip_lines: lines of a text file before its table.
        budget: memory for the variables; `SIZE_LIMIT` when None.

    Raises:
        InputError: no such file, empty, of unknown suffix, truncated or damaged, too large.
        OutOfMemoryError: the machine has too little memory.
    """
    with opened(path, budget or Budget()) as source:
        reader = bags if source.path.is_dir() else READERS[_known(source)]
        if reader is csv_table:
            return csv_table.read(source, want=want, skip_lines=skip_lines)
        if skip_lines:
            raise InputError(f"{source} is no text file; take skip_lines out of the map.")
        raw: Raw = reader.read(source, want=want)
        return raw


def _known(source: Source) -> str:
    """The suffix, if there is a reader for it; without a suffix, that of the file's content."""
    if source.suffix in READERS:
        return source.suffix
    if not source.suffix:
        return _by_content(source)
    known = ", ".join(READERS)
    near = difflib.get_close_matches(source.suffix, READERS, n=1, cutoff=ALIKE)
    rest = f"; did you mean '{near[0]}'?" if near else "; export it to one of these."
    raise InputError(
        f"{source} has the suffix '{source.suffix}', which no reader knows (known: {known}){rest}"
    )


def _by_content(source: Source) -> str:
    with source.path.open("rb") as file:
        head = file.read(_HEAD)
    found = next((suffix for begin, suffix in _BEGINS.items() if head.startswith(begin)), None)
    if found in bags.SUFFIXES:
        raise InputError(f"{source} is a ROS bag without a suffix; call it {source.path.name}{found}.")
    return found or ".csv"
