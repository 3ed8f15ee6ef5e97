"""MAT version 7.3, which is HDF5 with MATLAB's conventions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.raw import Raw, Want
from missing_physics.recordings.readers.base import reading

__all__ = ["is_hdf5", "read"]


def is_hdf5(path: Path) -> bool:
    """Whether the file is HDF5, whatever its header text says."""
    return bool(h5py.is_hdf5(path))


def read(path: Path, *, want: Want) -> Raw:
    """The numeric variables of a version 7.3 MAT file; see `missing_physics.recordings.readers.mat.read`."""
    found: dict[str, NDArray[Any]] = {}
    names: list[str] = []

    def visit(name: str, item: Any) -> None:
        label = name.replace("/", ".")
        if name.startswith("#") or not isinstance(item, h5py.Dataset) or not _numeric(item):
            return
        names.append(label)
        if want(label):
            # MATLAB stores by columns, HDF5 by rows: the file's shape is MATLAB's reversed.
            found[label] = np.asarray(item[()]).T

    with reading(path, "MAT 7.3"), h5py.File(path, "r") as file:
        file.visititems(visit)
        return Raw(str(path), found, tuple(names))
    raise AssertionError("unreachable: reading() raises")


def _numeric(item: Any) -> bool:
    kind = item.attrs.get("MATLAB_class", b"")
    text = kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)
    return item.dtype.kind in "biuf" and text not in {"char", "cell"} and "MATLAB_empty" not in item.attrs
