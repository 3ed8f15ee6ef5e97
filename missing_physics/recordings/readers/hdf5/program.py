"""The program that reads HDF5, run as a separate process, so that a crash affects nothing else.

    python program.py FILE

HDF5's library trusts the content of a file; some damaged ones end the process, or take any amount of memory
or time. So the memory and time of this process are limited.
`missing_physics.isolation.process` describes the protocol.
"""

from __future__ import annotations

import json
import math
import sys
import zlib
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from missing_physics.isolation.limits import Limits, fail, say, send

__all__ = ["main"]

#: HDF5's number of the only compression that MATLAB uses, and of filters that preserve a chunk's size.
_DEFLATE = h5py.h5z.FILTER_DEFLATE
_PLAIN = (h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32)
#: Largest expansion by deflate (RFC 1951: 258 bytes from two bits); size of a chunk that is not checked.
_MOST_DEFLATED = 1032
_HARMLESS = 1 << 26
#: Bytes that are inflated at once.
_BLOCK = 1 << 20
#: Cells of one array that are variables of their own.
MOST_CELLS = 256


def main(path: str) -> None:
    """See the module."""
    limits = Limits()
    try:
        limits.allow(0)
        with h5py.File(path, "r") as file:
            items = _datasets(file)
            declared = [_declared(name, item) for name, item in items.items()]
            say({"datasets": declared, "objects": _objects(file)})
            asked = json.loads(sys.stdin.readline() or '{"names": [], "size": 0}')
            limits.allow(asked["size"])
            for name in asked["names"]:
                send(_values(items[name]))
    except Exception as error:  # the library raises a dozen types, and documents none of them
        fail(error, limits)


def _datasets(file: h5py.File) -> dict[str, h5py.Dataset]:
    """Numeric datasets by name; those in MATLAB's cell arrays are named as there, ``log{1}``."""
    items: dict[str, h5py.Dataset] = {}

    def visit(name: str, item: Any) -> None:
        if name.startswith("#") or not isinstance(item, h5py.Dataset):
            return
        if _numeric(item):
            items[name] = item
        elif _class(item) == "cell" and item.dtype == h5py.ref_dtype and item.size <= MOST_CELLS:
            for k, reference in enumerate(item[()].ravel()):
                inner = file[reference]
                if isinstance(inner, h5py.Dataset) and _numeric(inner):
                    items[f"{name}{{{k + 1}}}"] = inner

    file.visititems(visit)
    return items


def _objects(file: h5py.File) -> dict[str, str]:
    """Objects of MATLAB's classes by name, with their class."""
    found = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset)}
    return {name: _class(item) for name, item in found.items() if "MATLAB_object_decode" in item.attrs}


def _class(item: h5py.Dataset) -> str:
    kind = item.attrs.get("MATLAB_class", b"")
    return kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)


def _numeric(item: h5py.Dataset) -> bool:
    real = item.shape is not None and item.dtype.kind in "biuf"
    closed = "MATLAB_empty" in item.attrs or "MATLAB_object_decode" in item.attrs
    return real and not closed and _class(item) not in {"char", "cell"}


def _declared(name: str, item: h5py.Dataset) -> dict[str, Any]:
    """Name, shape, bytes of an entry, and bytes of a chunk if it has any."""
    chunk = math.prod(item.chunks) * item.dtype.itemsize if item.chunks else 0
    return {"name": name, "shape": item.shape, "entry": item.dtype.itemsize, "chunk": chunk}


def _values(item: h5py.Dataset) -> NDArray[Any]:
    """The numbers, after checks that HDF5 will read no other files and no more bytes than declared.

    Raises:
        ValueError: data in another file, a compression that MATLAB does not use, a chunk that is too long.
    """
    if item.external or item.is_virtual:
        raise ValueError(f"{item.name} lies in another file")
    if item.chunks is not None:
        _check_chunks(item)
    return np.ascontiguousarray(item[()]).reshape(item.shape)


def _check_chunks(item: h5py.Dataset) -> None:
    """Check chunk lengths, since HDF5 inflates a whole chunk before comparing with the declared length."""
    properties = item.id.get_create_plist()
    codes = [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
    if not set(codes) <= {_DEFLATE, *_PLAIN} or codes.count(_DEFLATE) > 1:
        raise ValueError(f"{item.name} is compressed by other means than MATLAB's")
    if _DEFLATE not in codes:
        return
    declared = math.prod(item.chunks) * item.dtype.itemsize
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


if __name__ == "__main__":
    main(sys.argv[1])
