"""One reader per format, chosen by the file's suffix.

A reader is a module with ``SUFFIXES`` and ``read(path, *, want) -> Raw``; a new format (a bag of ROS
messages, say) is a new file and one line here.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType, ModuleType

from missing_physics.recordings.raw import Raw, Want, everything
from missing_physics.recordings.readers import csv_table, json_samples, mat, npz, parquet
from robot_model import InputError

__all__ = ["READERS", "read_raw"]

_MODULES: tuple[ModuleType, ...] = (csv_table, parquet, mat, npz, json_samples)

#: Suffix (lower case, with its dot) to the module that reads it.
READERS: Mapping[str, ModuleType] = MappingProxyType(
    {suffix: module for module in _MODULES for suffix in module.SUFFIXES}
)

#: A suffix this much like a known one is a typing error.
ALIKE = 0.7


def read_raw(path: str | os.PathLike[str], *, want: Want = everything, skip_lines: int = 0) -> Raw:
    """The variables of a file.

    Args:
        path: the file; its suffix says the format.
        want: which variables to read, by name.
        skip_lines: lines of a text file before its table.

    Raises:
        InputError: no such file, empty, of unknown suffix, truncated or damaged.
    """
    file = Path(path)
    if not file.is_file():
        kind = "is a folder, not a recording" if file.is_dir() else "does not exist"
        raise InputError(f"{path} {kind}; give the path of a recording.")
    suffix = file.suffix.lower()
    if suffix not in READERS:
        known = ", ".join(READERS)
        near = difflib.get_close_matches(suffix, READERS, n=1, cutoff=ALIKE)
        rest = f"; did you mean '{near[0]}'?" if near else "; export it to one of these."
        raise InputError(f"{path} has the suffix '{suffix}', which no reader knows (known: {known}){rest}")
    try:
        size = file.stat().st_size
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror or error}).") from None
    if size == 0:
        raise InputError(f"{path} is empty; record or export it again.")
    raw: Raw
    if READERS[suffix] is csv_table:
        raw = csv_table.read(file, want=want, skip_lines=skip_lines)
    elif skip_lines:
        raise InputError(f"{path} is no text file; take skip_lines out of the map.")
    else:
        raw = READERS[suffix].read(file, want=want)
    return raw
