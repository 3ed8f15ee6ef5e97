"""MAT: MATLAB's own files, version 4 to 7.3.

Versions 4 to 7 are decoded here, not by SciPy: `scipy.io.loadmat` trusts the element tags of a version 5 file
in C, so a zeroed tag ends the process, or lets it write outside its arrays. These readers use only Python and
NumPy and compare every length with the available bytes, so damaged files can only raise an error; and they
know sizes before unpacking. Version 7.3 is HDF5, whose library crashes on some damaged files, so h5py reads
it in a separate process.
"""

from __future__ import annotations

from missing_physics.recordings.channels.raw import Raw, Want
from missing_physics.recordings.readers.base import reading
from missing_physics.recordings.readers.hdf5 import is_hdf5, read_datasets
from missing_physics.recordings.readers.mat import v4, v5
from missing_physics.recordings.readers.objects import closed_objects
from missing_physics.recordings.readers.source import Source

__all__ = ["SUFFIXES", "read"]

SUFFIXES = (".mat",)

#: The first bytes of a version 7.3 file's text header.
_VERSION_73 = b"MATLAB 7.3"
#: Bytes of which one is zero in version 4, whose first number is below 5000, and none later.
_MARK = 4


def read(source: Source, *, want: Want) -> Raw:
    """The variables of a MAT file in MATLAB's shapes, fields of structures flattened with dots.

    Cells are named as in MATLAB, ``log{1}``. Text, complex and sparse arrays, function handles and objects of
    classes are skipped. Raises `InputError` when the file is truncated or damaged.
    """
    with source.path.open("rb") as file:
        head = file.read(len(_VERSION_73))
    if head == _VERSION_73 or is_hdf5(source):
        return read_datasets(source, want=want, kind="MAT 7.3", by_columns=True)
    with reading(source, "MAT"):
        objects: dict[str, str] = {}
        if 0 in head[:_MARK]:
            found = v4.variables(source, want=want)
        else:
            found, objects = v5.variables(source, want=want)
        kept = {name: values for name, values in found.items() if values is not None}
        return Raw(source.name, kept, tuple(found), objects=closed_objects(objects))
    raise AssertionError("unreachable: reading() raises")
