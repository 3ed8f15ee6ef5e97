"""NPZ: NumPy arrays by name; never a pickle. Noise and resolution are in ``noise/NAME`` and
``resolution/NAME``."""

from __future__ import annotations

import math
import warnings
import zipfile
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from missing_physics.recordings.channels.raw import Raw, Want
from missing_physics.recordings.readers.base import reading
from missing_physics.recordings.readers.budget import NUMBER
from missing_physics.recordings.readers.source import Source
from robot_model import InputError

__all__ = ["NOISE", "RESOLUTION", "SUFFIXES", "read"]

SUFFIXES = (".npz",)
NOISE = "noise/"
RESOLUTION = "resolution/"
_NPY = ".npy"
#: Bytes at the begin of an array in which its header must lie.
_HEAD = 1 << 16


class _Header(NamedTuple):
    """The declaration of an array, and the number of bytes stored for it."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    stored: int


def read(source: Source, *, want: Want) -> Raw:
    """The arrays of an NPZ file. Raises `InputError` when it is damaged or holds Python objects."""
    found: dict[str, NDArray[Any]] = {}
    names: list[str] = []
    known: dict[str, dict[str, float]] = {NOISE: {}, RESOLUTION: {}}
    with reading(source, "NPZ"), _archive(source) as archive:
        for name in (member[: -len(_NPY)] for member in archive.namelist() if member.endswith(_NPY)):
            header = _header(archive, name)
            kind = next((prefix for prefix in known if name.startswith(prefix)), None)
            if kind is not None:
                known[kind][name.removeprefix(kind)] = _number(archive, name, header)
                continue
            fields = _field_names(name, header.dtype)
            names += dict.fromkeys([name, *fields])
            if want(name) or any(map(want, fields)):
                found |= _flattened(name, _array(source, archive, name, header))
        return Raw(source.name, found, tuple(names), noise=known[NOISE], resolution=known[RESOLUTION])
    raise AssertionError("unreachable: reading() raises")


def _archive(source: Source) -> zipfile.ZipFile:
    with source.path.open("rb") as file:
        if file.read(len(npy.MAGIC_PREFIX)) == npy.MAGIC_PREFIX:
            raise InputError(f"{source} is a single array, not an NPZ archive of named arrays.")
    return zipfile.ZipFile(source.path)


def _header(archive: zipfile.ZipFile, name: str) -> _Header:
    """The header; raises ValueError if a damaged one declares more bytes than are stored."""
    info = archive.getinfo(name + _NPY)
    with archive.open(info) as stream:
        head = BytesIO(stream.read(_HEAD))
    version = npy.read_magic(head)
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python's parser warns of what damaged headers hold
            shape, _, dtype = read_header(head)
    except MemoryError:  # Python's own parser says so of too many signs in a row
        raise ValueError(f"{name} has no header") from None
    stored = info.file_size - head.tell()
    if not dtype.hasobject and math.prod(shape) * dtype.itemsize > stored:
        raise ValueError(f"{name} declares {shape} entries, but has {stored} bytes of them")
    return _Header(shape, dtype, stored)


def _array(source: Source, archive: zipfile.ZipFile, name: str, header: _Header) -> NDArray[Any]:
    source.budget.take_array(source, name, header.shape, _entry_size(header.dtype))
    with archive.open(name + _NPY) as stream:
        return np.asarray(npy.read_array(stream, allow_pickle=False))


def _number(archive: zipfile.ZipFile, name: str, header: _Header) -> float:
    if math.prod(header.shape) != 1 or header.dtype.kind not in "iuf":
        raise ValueError(f"{name} is not one number")
    with archive.open(name + _NPY) as stream:
        return float(npy.read_array(stream, allow_pickle=False).reshape(()))


def _entry_size(dtype: np.dtype[Any]) -> int:
    """Bytes of an entry after conversion to float64."""
    if dtype.subdtype is not None:
        return math.prod(dtype.shape) * _entry_size(dtype.base)
    if dtype.names is None:
        return max(dtype.itemsize, NUMBER)
    return sum(_entry_size(dtype[field]) for field in dtype.names)


def _field_names(name: str, dtype: np.dtype[Any]) -> list[str]:
    """Names of the variables of a structured array, at any depth; none for a plain array."""
    found: list[str] = []
    for field in dtype.names or ():
        label = f"{name}.{field}"
        found += _field_names(label, dtype[field].base) or [label]
    return found


def _flattened(name: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """An array as one variable, a structured one as one variable per field, at any depth."""
    if values.dtype.names is None:
        return {name: values}
    found: dict[str, NDArray[Any]] = {}
    for field in values.dtype.names:
        found |= _flattened(f"{name}.{field}", values[field])
    return found
