"""Several files as one stream of bytes, to pass them between processes without writing them to disk."""

from __future__ import annotations

import json
from collections.abc import Mapping

__all__ = ["packed", "unpacked"]


def packed(files: Mapping[str, bytes]) -> bytes:
    """A line with names and lengths, followed by the contents."""
    lengths = {name: len(content) for name, content in files.items()}
    return b"\n".join([json.dumps(lengths).encode(), b"".join(files.values())])


def unpacked(parcel: bytes) -> dict[str, bytes]:
    """The files of a parcel; raises ValueError if its length is wrong."""
    head, _, rest = parcel.partition(b"\n")
    files: dict[str, bytes] = {}
    for name, length in json.loads(head).items():
        files[name], rest = rest[:length], rest[length:]
        if len(files[name]) != length:
            raise ValueError(f"{name} breaks off.")
    if rest:
        raise ValueError("there is more than was announced.")
    return files
