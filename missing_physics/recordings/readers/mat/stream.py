"""Sequential bytes, from a file or unpacked from a part of it, never more than requested."""

from __future__ import annotations

import os
import zlib
from typing import Any, BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.readers.source import Source

__all__ = ["Plain", "Stream", "Unpacked", "read_array"]

#: Number of bytes unpacked, or skipped, at once.
_BLOCK = 1 << 16
#: Number of bytes that may follow a compressed variable as padding of its last element.
_PADDING = 8


class Stream(Protocol):
    """Bytes that are read once.

    Attributes:
        at: number of bytes read or skipped.
    """

    at: int

    def fill(self, target: memoryview) -> None:
        """Read as many bytes as `target` has. Raises ValueError if there are fewer."""

    def skip(self, count: int) -> None:
        """Skip bytes. Raises ValueError if there are fewer."""


def read_array(stream: Stream, count: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    """The next `count` entries of `dtype` in the machine's byte order, shape (count,)."""
    values = np.empty(count, dtype=dtype)
    stream.fill(values.view(np.uint8).data)
    return values.astype(dtype.newbyteorder("="), copy=False)


class Plain:
    """The bytes of a file."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.at = 0
        self.size = os.fstat(file.fileno()).st_size

    def fill(self, target: memoryview) -> None:
        """See `Stream`."""
        if self._file.readinto(target) != target.nbytes:  # type: ignore[attr-defined]
            raise ValueError(f"it ends within {target.nbytes} bytes at byte {self.at}")
        self.at += target.nbytes

    def skip(self, count: int) -> None:
        """See `Stream`."""
        if not 0 <= count <= self.size - self.at:
            raise ValueError(f"it ends within {count} bytes at byte {self.at}")
        self._file.seek(count, os.SEEK_CUR)
        self.at += count


class Unpacked:
    """The unpacked content of the next `packed` bytes of a file."""

    def __init__(self, plain: Plain, packed: int, source: Source) -> None:
        self._plain, self._left, self._source = plain, packed, source
        self._decompressor = zlib.decompressobj()
        self.at = 0

    def fill(self, target: memoryview) -> None:
        """See `Stream`."""
        done = 0
        while done < target.nbytes:
            block = self._block(min(target.nbytes - done, _BLOCK))
            target[done : done + len(block)] = block
            done += len(block)

    def skip(self, count: int) -> None:
        """See `Stream`; skipped bytes count in the budget like kept ones, since unpacking takes time."""
        if count < 0:
            raise ValueError("an element is longer than what it is part of")
        end = self.at + count
        while self.at < end:
            block = self._block(min(end - self.at, _BLOCK))
            self._source.budget.take(len(block), f"{self._source} holds compressed variables")

    def finish(self) -> None:
        """Raises ValueError unless everything is unpacked and its checksum is right."""
        end = self.at + _PADDING
        while not self._decompressor.eof:
            self.at += len(self._decompressor.decompress(self._waiting(), 1))
            if self.at > end:
                raise ValueError("a compressed variable is longer than it declares")

    def _block(self, most: int) -> bytes:
        """At least one more byte, at most `most`."""
        while not self._decompressor.eof:
            if block := self._decompressor.decompress(self._waiting(), most):
                self.at += len(block)
                return block
        raise ValueError("a compressed variable ends too early")

    def _waiting(self) -> bytes | bytearray:
        """Packed bytes that are next to be unpacked."""
        if self._decompressor.unconsumed_tail:
            return self._decompressor.unconsumed_tail
        if not self._left:
            raise ValueError("a compressed variable ends too early")
        packed = bytearray(min(self._left, _BLOCK))
        self._plain.fill(memoryview(packed))
        self._left -= len(packed)
        return packed
