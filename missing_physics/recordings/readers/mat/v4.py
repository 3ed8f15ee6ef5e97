"""MAT version 4: a header of five numbers, a name and a matrix, one after another.

The format: MathWorks, "MAT-File Format", section "Level 4 MAT-File Format".
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.raw import Want
from missing_physics.recordings.readers.mat.stream import Plain, read_array
from missing_physics.recordings.readers.source import Source
from robot_model import InputError

__all__ = ["variables"]

#: A header's first number is ``1000 order + 10 type + kind``: the byte order (further ones are of machines
#: without IEEE 754), the type of the numbers, and whether it is a full matrix, text or a sparse matrix.
_TYPES = ("f8", "f4", "i4", "i2", "u2", "u1")
_ORDERS, _MOST_ORDERS = 2, 5
_FULL, _KINDS = 0, 3
#: Bytes of a name, including its terminating zero; MATLAB allows 64.
_LONGEST_NAME = 4096


def variables(source: Source, *, want: Want) -> dict[str, NDArray[Any] | None]:
    """The numeric variables of a file, None for those that are not wanted.

    Raises:
        ValueError: truncated or damaged.
    """
    found: dict[str, NDArray[Any] | None] = {}
    with source.path.open("rb") as file:
        first = int.from_bytes(file.read(4), "little")
        file.seek(0)
        order = "<" if first < 1000 * _MOST_ORDERS else ">"
        plain = Plain(file)
        while plain.at < plain.size:
            _matrix(plain, order, source, want, found)
    return found


def _matrix(
    plain: Plain, order: str, source: Source, want: Want, found: dict[str, NDArray[Any] | None]
) -> None:
    begin = plain.at
    code, rows, columns, imaginary, letters = map(int, read_array(plain, 5, np.dtype(f"{order}i4")))
    dtype = np.dtype(order + _type(code, source))
    size = rows * columns * dtype.itemsize
    if min(rows, columns) < 0 or not 0 < letters <= _LONGEST_NAME or imaginary not in (0, 1):
        raise ValueError(f"no header of a matrix at byte {begin}")
    name = read_array(plain, letters, np.dtype("u1")).tobytes().split(b"\0")[0].decode("latin-1")
    if code % 10 != _FULL or imaginary:
        plain.skip(size * (1 + imaginary))
    elif not want(name):
        found[name] = None
        plain.skip(size)
    elif size > plain.size - plain.at:
        raise ValueError(f"{name} is cut off")
    else:
        source.budget.take_array(source, name, (rows, columns), dtype.itemsize)
        found[name] = read_array(plain, rows * columns, dtype).reshape((rows, columns), order="F")


def _type(code: int, source: Source) -> str:
    order, rest = divmod(code, 1000)
    if not 0 <= order < _MOST_ORDERS or rest // 10 >= len(_TYPES) or rest % 10 >= _KINDS:
        raise ValueError(f"{code} is no code of a matrix")
    if order >= _ORDERS:
        raise InputError(f"{source} has numbers of a VAX or a Cray; save it on another machine.")
    return _TYPES[rest // 10]
