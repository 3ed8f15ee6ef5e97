"""MAT version 7.3, which is HDF5 with MATLAB's conventions."""

from __future__ import annotations

import math
import zlib
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.raw import Raw, Want
from missing_physics.recordings.readers.base import reading
from missing_physics.recordings.readers.source import Source

__all__ = ["is_hdf5", "read"]

#: HDF5's number of the one compression that MATLAB uses, and of filters that leave a chunk's size as it is.
_DEFLATE = h5py.h5z.FILTER_DEFLATE
_PLAIN = (h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32)
#: What deflate makes of a byte at most (RFC 1951: 258 bytes from two bits); what a chunk may become unseen.
_MOST_DEFLATED = 1032
_HARMLESS = 1 << 26
#: Bytes that are inflated at once.
_BLOCK = 1 << 20


def is_hdf5(source: Source) -> bool:
    """Whether the file is HDF5, whatever its header text says."""
    return bool(h5py.is_hdf5(source.path))


def read(source: Source, *, want: Want) -> Raw:
    """The numeric variables of a version 7.3 MAT file; see `missing_physics.recordings.readers.mat.read`."""
    items: dict[str, h5py.Dataset] = {}

    def visit(name: str, item: Any) -> None:
        if not name.startswith("#") and isinstance(item, h5py.Dataset) and _numeric(item):
            items[name.replace("/", ".")] = item

    with reading(source, "MAT 7.3"), h5py.File(source.path, "r") as file:
        file.visititems(visit)
        wanted = {label: item for label, item in items.items() if want(label)}
        for label, item in wanted.items():
            source.budget.take_array(source, label, item.shape, item.dtype.itemsize)
        # MATLAB stores by columns, HDF5 by rows: the file's shape is MATLAB's reversed.
        found: dict[str, NDArray[Any]] = {label: _values(item, source).T for label, item in wanted.items()}
        return Raw(source.name, found, tuple(items))
    raise AssertionError("unreachable: reading() raises")


def _numeric(item: h5py.Dataset) -> bool:
    kind = item.attrs.get("MATLAB_class", b"")
    text = kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)
    real = item.shape is not None and item.dtype.kind in "biuf"
    return real and text not in {"char", "cell"} and "MATLAB_empty" not in item.attrs


def _values(item: h5py.Dataset, source: Source) -> NDArray[Any]:
    """The numbers, once nothing in the file can lead HDF5 to other files or to more bytes than declared.

    Raises:
        ValueError: data in another file, a compression that MATLAB does not use, a chunk that is too long.
    """
    if item.external or item.is_virtual:
        raise ValueError(f"{item.name} lies in another file")
    if item.chunks is not None:
        _check_chunks(item, source)
    return np.asarray(item[()])


def _check_chunks(item: h5py.Dataset, source: Source) -> None:
    """HDF5 inflates a chunk to whatever length it has, before it compares that with the declared one."""
    properties = item.id.get_create_plist()
    codes = [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
    if not set(codes) <= {_DEFLATE, *_PLAIN} or codes.count(_DEFLATE) > 1:
        raise ValueError(f"{item.name} is compressed by other means than MATLAB's")
    declared = math.prod(item.chunks) * item.dtype.itemsize
    source.budget.take(declared, f"{source} declares {item.name} in chunks of {declared} bytes")
    if _DEFLATE not in codes:
        return
    deflated = 1 << codes.index(_DEFLATE)
    stored: list[h5py.h5d.StoreInfo] = []
    item.id.chunk_iter(stored.append)
    for chunk in stored:
        if not chunk.filter_mask & deflated and chunk.size * _MOST_DEFLATED > max(declared, _HARMLESS):
            _check_inflated(item, chunk, declared)


def _check_inflated(item: h5py.Dataset, chunk: h5py.h5d.StoreInfo, declared: int) -> None:
    _, data = item.id.read_direct_chunk(chunk.chunk_offset)
    decompressor = zlib.decompressobj()
    length = 0
    while block := decompressor.decompress(data, _BLOCK):
        length += len(block)
        data = decompressor.unconsumed_tail
        if length > declared:
            raise ValueError(f"{item.name} has a chunk that unpacks to more than it declares")
