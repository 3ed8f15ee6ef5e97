"""Tagged elements of MAT versions 5 to 7, each read only within its enclosing element.

The format: MathWorks, "MAT-File Format", section "Level 5 MAT-File Format".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.readers.mat.stream import Stream, read_array

__all__ = ["CELLS", "COMPRESSED", "Header", "Part", "Tag"]

#: Types of elements (table 1-1): numbers, a matrix, a compressed matrix.
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_MATRIX, COMPRESSED = 14, 15
#: Elements fill up words of this many bytes.
_WORD = 8
#: Bytes of an element that describes a matrix: its dimensions, its name, the names of its fields.
_LONGEST = 1 << 20
#: Dimensions that an array may have.
_MOST_DIMENSIONS = 32
#: Classes of matrices (table 1-3): cells, structure, object with fields, numbers; what has no shape.
CELLS = 1
_STRUCTURE, _OBJECT, _NUMERIC, _OPAQUE = 2, 3, range(6, 16), 17
#: Flag of a matrix that has imaginary parts.
_COMPLEX = 1 << 11


class Tag(NamedTuple):
    """The tag before an element's bytes.

    Attributes:
        kind: type of the element.
        size: number of bytes.
        small: the bytes, if they are in the tag itself.
    """

    kind: int
    size: int
    small: bytes | None


@dataclass(frozen=True)
class Header:
    """The header of a matrix.

    Attributes:
        kind: its class.
        complex: whether imaginary parts follow.
        shape: its dimensions.
        name: empty for part of another matrix.
        of_class: class of an object that only MATLAB can open; else empty.
    """

    kind: int
    complex: bool
    shape: tuple[int, ...]
    name: str
    of_class: str = ""

    @property
    def count(self) -> int:
        """Number of entries or structures."""
        return math.prod(self.shape)

    @property
    def numeric(self) -> bool:
        """Whether it holds real numbers."""
        return self.kind in _NUMERIC and not self.complex

    @property
    def structured(self) -> bool:
        """Whether it holds structures, or objects that are stored like them."""
        return self.kind in (_STRUCTURE, _OBJECT)


class Part:
    """Elements of a stream from its place on, up to `end`."""

    def __init__(self, stream: Stream, order: str, end: float) -> None:
        self.stream, self.order, self.end = stream, order, end

    @property
    def left(self) -> float:
        """Bytes up to the end."""
        return self.end - self.stream.at

    def tag(self) -> Tag:
        """The next tag. Raises ValueError if its element would be longer than the enclosing one."""
        word = int(self._array(1, "u4")[0])
        if word >> 16:
            size = word >> 16
            if size > _WORD // 2:
                raise ValueError(f"a tag of four bytes declares {size} at byte {self.stream.at}")
            return Tag(word & 0xFFFF, size, self._array(_WORD // 2, "u1").tobytes()[:size])
        size = int(self._array(1, "u4")[0])
        if size > self.left:
            raise ValueError(f"an element of {size} bytes is cut off at byte {self.stream.at}")
        return Tag(word, size, None)

    def inside(self, tag: Tag) -> Part:
        """The elements inside an element."""
        if tag.kind != _MATRIX or tag.small:
            raise ValueError(f"type {tag.kind} where a matrix is expected at byte {self.stream.at}")
        return Part(self.stream, self.order, self.stream.at + tag.size)

    def leave(self) -> None:
        """Skip the remaining bytes."""
        self.stream.skip(int(self.left))

    def short(self) -> bytes:
        """The bytes of an element that describes a matrix."""
        tag = self.tag()
        if tag.small is not None:
            return tag.small
        if tag.size > _LONGEST:
            raise ValueError(f"{tag.size} bytes describe a matrix at byte {self.stream.at}")
        content = self._array(tag.size, "u1").tobytes()
        self._fill_up(tag)
        return content

    def integers(self) -> list[int]:
        """The integers of such an element."""
        return [int(value) for value in np.frombuffer(self.short(), dtype=f"{self.order}i4")]

    def text(self) -> str:
        """The text of such an element."""
        return _letters(self.short())

    def header(self) -> Header:
        """The header of the matrix that begins here."""
        flags = self.integers()
        if len(flags) != 2:
            raise ValueError(f"no flags of a matrix at byte {self.stream.at}")
        kind = flags[0] & 0xFF
        if kind == _OPAQUE:
            name, system, of_class = (self.text() if self.left else "" for _ in range(3))
            return Header(kind, False, (), name, of_class or system or "?")
        shape = tuple(self.integers())
        if not 2 <= len(shape) <= _MOST_DIMENSIONS or min(shape) < 0:
            raise ValueError(f"no dimensions of a matrix at byte {self.stream.at}")
        return Header(kind, bool(flags[0] & _COMPLEX), shape, self.text())

    def field_names(self, header: Header) -> list[str]:
        """Names of the fields of structures, after their header."""
        if header.kind == _OBJECT:
            self.short()  # the name of its class
        lengths, names = self.integers(), self.short()
        if len(lengths) != 1 or lengths[0] <= 0:
            raise ValueError(f"no length of field names at byte {self.stream.at}")
        starts = range(0, len(names) - lengths[0] + 1, lengths[0])
        return [_letters(names[k : k + lengths[0]]) for k in starts]

    def numbers_tag(self, header: Header) -> tuple[Tag, np.dtype[Any]]:
        """Tag and type of the numbers of a matrix. Raises ValueError unless there are as many as declared."""
        tag = self.tag()
        if tag.kind not in _NUMBERS:
            raise ValueError(f"type {tag.kind} where numbers are expected at byte {self.stream.at}")
        dtype = np.dtype(self.order + _NUMBERS[tag.kind])
        if tag.size != header.count * dtype.itemsize:
            raise ValueError(f"{tag.size} bytes for {header.count} numbers at byte {self.stream.at}")
        return tag, dtype

    def numbers(self, header: Header, tag: Tag, dtype: np.dtype[Any]) -> NDArray[Any]:
        """The numbers of a matrix in its shape, after their tag."""
        if tag.small is not None:
            values = np.frombuffer(tag.small, dtype=dtype).astype(dtype.newbyteorder("="))
        else:
            values = read_array(self.stream, header.count, dtype)
            self._fill_up(tag)
        return values.reshape(header.shape, order="F")

    def _array(self, count: int, kind: str) -> NDArray[Any]:
        dtype = np.dtype(self.order + kind)
        if count * dtype.itemsize > self.left:
            raise ValueError(f"an element is cut off at byte {self.stream.at}")
        return read_array(self.stream, count, dtype)

    def _fill_up(self, tag: Tag) -> None:
        self._array(int(min(-tag.size % _WORD, self.left)), "u1")


def _letters(content: bytes) -> str:
    """Text up to its terminating zero; Latin-1 for versions before UTF-8."""
    text = content.split(b"\0")[0]
    try:
        return text.decode("utf-8")
    except UnicodeDecodeError:
        return text.decode("latin-1")
