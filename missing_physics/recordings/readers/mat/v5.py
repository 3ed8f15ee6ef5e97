"""MAT versions 5 to 7: matrices, which may be compressed, and nested structures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.raw import Want
from missing_physics.recordings.readers.mat.elements import CELLS, COMPRESSED, Header, Part, Tag
from missing_physics.recordings.readers.mat.stream import Plain, Unpacked, read_array
from missing_physics.recordings.readers.source import Source

__all__ = ["variables"]

#: Bytes of the header of a file; the last two give its byte order.
_HEADER = 128
_ORDERS = {b"IM": "<", b"MI": ">"}
#: Depth of structures in structures.
_DEEPEST = 64
#: Assumed cost of an entry of an array of structures [bytes]: it takes less memory, but more time.
_CELL = 1000
#: Cells of one array that are variables of their own.
MOST_CELLS = 256


def variables(source: Source, *, want: Want) -> tuple[dict[str, NDArray[Any] | None], dict[str, str]]:
    """The numeric variables of a file, None for those that are not wanted; classes of its objects by name.

    Raises:
        ValueError: truncated or damaged.
    """
    with source.path.open("rb") as file:
        plain = Plain(file)
        mark = read_array(plain, _HEADER, np.dtype("u1")).tobytes()[-2:]
        if mark not in _ORDERS:
            raise ValueError(f"no byte order at byte {_HEADER - len(mark)}")
        reader = _Reader(source, want, {}, {})
        whole = Part(plain, _ORDERS[mark], plain.size)
        while whole.left:
            tag = whole.tag()
            end = plain.at + tag.size
            if tag.kind == COMPRESSED:
                reader.compressed(plain, tag, whole.order)
            else:
                reader.matrix(whole.inside(tag))
            plain.skip(end - plain.at)
    return reader.found, reader.objects


@dataclass(frozen=True)
class _Reader:
    """Collects the variables of a file."""

    source: Source
    want: Want
    found: dict[str, NDArray[Any] | None]
    objects: dict[str, str]

    def compressed(self, plain: Plain, tag: Tag, order: str) -> None:
        """Read a compressed variable; one that is not wanted is unpacked only up to its name."""
        unpacked = Unpacked(plain, tag.size, self.source)
        whole = Part(unpacked, order, math.inf)
        part = whole.inside(whole.tag())
        if self.matrix(part):
            part.leave()
            unpacked.finish()

    def matrix(self, part: Part, label: str = "", depth: int = 0) -> bool:
        """Read a variable or a field of one; returns whether more than its name was read.

        Args:
            part: its elements.
            label: its name if it has none in the file.
            depth: number of enclosing structures.
        """
        header = part.header()
        label = label or header.name
        if header.of_class and label:
            self.objects[label] = header.of_class
            return False
        if header.kind == CELLS and label:
            self._cells(part, header, label, depth)
            return True
        if header.structured and label:
            self._structures(part, header, label, depth)
            return True
        if not header.numeric or not label:
            return False
        self.found[label] = self._numbers(part, header, label) if self.want(label) else None
        return self.found[label] is not None

    def _numbers(self, part: Part, header: Header, label: str) -> NDArray[Any]:
        tag, dtype = part.numbers_tag(header)
        self.source.budget.take_array(self.source, label, header.shape, dtype.itemsize)
        return part.numbers(header, tag, dtype)

    def _structures(self, part: Part, header: Header, label: str, depth: int) -> None:
        """Read one structure, whose fields are variables, or an array of them, whose fields are columns."""
        if depth > _DEEPEST:
            raise ValueError("structures are nested too deeply")
        fields = [f"{label}.{name}" for name in part.field_names(header)]
        if header.count != 1:
            self._columns(part, header, label, fields)
            return
        for field in fields:
            inner = part.inside(part.tag())
            if inner.left:
                self.matrix(inner, field, depth + 1)
                inner.leave()

    def _cells(self, part: Part, header: Header, label: str, depth: int) -> None:
        """Read cells as variables, named as in MATLAB, ``log{1}``; many with one number each are a column."""
        if depth > _DEEPEST:
            raise ValueError("cells are nested too deeply")
        if header.count > MOST_CELLS:
            self._columns(part, header, "", [label])
            return
        for k in range(header.count):
            inner = part.inside(part.tag())
            if inner.left:
                self.matrix(inner, f"{label}{{{k + 1}}}", depth + 1)
                inner.leave()

    def _columns(self, part: Part, header: Header, label: str, fields: list[str]) -> None:
        """Read an array of structures: each field with single numbers is one variable."""
        cells = header.count * len(fields)
        of = f"structures of {len(fields)} fields in {label}" if label else f"cells in {fields[0]}"
        claim = f"{self.source} declares {header.count} {of}"
        self.source.budget.take(cells * _CELL, claim)
        columns: dict[str, list[Any]] = {field: [] for field in fields}
        for _ in range(header.count):
            for field in fields:
                value = _scalar(part.inside(part.tag()))
                if value is None:
                    columns.pop(field, None)
                elif field in columns:
                    columns[field].append(value)
        order = np.arange(header.count).reshape(header.shape, order="F").ravel()
        for field, values in columns.items():
            if values:
                self.found[field] = np.array(values)[order] if self.want(field) else None


def _scalar(part: Part) -> Any:
    """The number of a matrix with one entry, else None."""
    value = None
    if part.left:
        header = part.header()
        if header.numeric and header.count == 1:
            value = part.numbers(header, *part.numbers_tag(header)).reshape(())[()]
    part.leave()
    return value
