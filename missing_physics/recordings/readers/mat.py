"""MAT: MATLAB's own files, version 4 to 7 through SciPy and version 7.3 (HDF5) through h5py."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from numpy.typing import NDArray

from missing_physics.recordings.raw import Raw, Want
from missing_physics.recordings.readers import mat73
from missing_physics.recordings.readers.base import flattened_records, reading

__all__ = ["SUFFIXES", "read"]

SUFFIXES = (".mat",)

#: The first bytes of a version 7.3 file's text header.
_VERSION_73 = b"MATLAB 7.3"


def read(path: Path, *, want: Want) -> Raw:
    """The variables of a MAT file in MATLAB's shapes, fields of structures flattened with dots.

    Text, cells, function handles and objects of classes are left out. Raises `InputError` when the file
    is truncated or damaged.
    """
    with path.open("rb") as file:
        head = file.read(len(_VERSION_73))
    if head == _VERSION_73 or mat73.is_hdf5(path):
        return mat73.read(path, want=want)
    with reading(path, "MAT"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # SciPy warns of duplicate and unreadable objects, which we drop
        content = scipy.io.loadmat(path, appendmat=False)
        found: dict[str, NDArray[Any]] = {}
        for name, value in content.items():
            if isinstance(name, str) and not name.startswith("__") and isinstance(value, np.ndarray):
                found |= {k: v for k, v in flattened_records(name, value).items() if v.dtype.kind in "biuf"}
        return Raw(str(path), {k: v for k, v in found.items() if want(k)}, tuple(found))
    raise AssertionError("unreachable: reading() raises")
