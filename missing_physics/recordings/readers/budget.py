"""Memory budget for the variables of a recording; sizes are checked before anything is unpacked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import ROUND_CEILING, Context

from robot_model import InputError

__all__ = ["NUMBER", "SIZE_LIMIT", "Budget"]

#: Default memory limit for the variables of one recording [bytes]. Reading and checking temporarily
#: hold up to three copies, for which a machine with 8 GB has enough memory.
SIZE_LIMIT = 2e9
#: Smallest size of a number in memory [bytes], whatever its size in the file, since all become float64.
NUMBER = 8
#: Significant digits of the proposed limit, which is rounded up.
_DIGITS = Context(prec=3, rounding=ROUND_CEILING)


class Budget:
    """Remaining bytes for variables; shared by all files of one recording."""

    def __init__(self, limit: float = SIZE_LIMIT) -> None:
        """Raises `InputError` when `limit` [bytes] is no positive number."""
        if not limit > 0:
            raise InputError(f"a size limit of {limit / 1e9:g} GB leaves nothing to read; give more than 0.")
        self.limit = limit
        self.taken = 0

    def take(self, size: int, claim: str) -> None:
        """Take `size` bytes of the remaining ones.

        Args:
            size: memory of the item [bytes].
            claim: beginning of the error sentence: which file declares what.

        Raises:
            InputError: fewer bytes remain.
        """
        before, self.taken = self.taken, self.taken + size
        if self.taken > self.limit:
            needed = float(_DIGITS.create_decimal(self.taken)) / 1e9
            more = " with what is read before it" if before else ""
            raise InputError(
                f"{claim}, which takes {needed:g} GB of memory{more}; at most {self.limit / 1e9:g} GB are "
                f"read: keep fewer samples or columns, or allow more (--size-limit {needed:g})."
            )

    def take_array(self, file: object, name: str, shape: Sequence[int], itemsize: int) -> None:
        """Take an array's size; see `take`.

        Args:
            file: what declares it.
            name: of the variable.
            shape: its shape.
            itemsize: bytes of an entry in the file.
        """
        entries = " x ".join(map(str, shape)) or "1"
        self.take(math.prod(shape) * max(itemsize, NUMBER), f"{file} declares {name} with {entries} entries")
