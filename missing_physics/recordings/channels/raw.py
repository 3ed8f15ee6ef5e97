"""`Raw`: the variables of a file, before they are interpreted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_model import InputError, nearest

__all__ = ["SHOWN_NAMES", "Raw", "Want", "everything"]

#: Decides by its name whether a variable is read, which saves memory for wide files.
Want = Callable[[str], bool]

#: How many names of a file an error shows.
SHOWN_NAMES = 8


def everything(name: str) -> bool:
    """A `Want` that keeps every variable."""
    return True


@dataclass(frozen=True)
class Raw:
    """Named arrays of one file.

    Attributes:
        source: displayed name of the file.
        variables: name to array of any shape; fields of structures are flattened with dots
            (``rec.act_pos_mot_deg``). Numbers, booleans, text and instants (``datetime64[ns]``) occur.
        names: all names in the file, read or not.
        first_row: displayed row number of the first sample: 2 below a header row, else 1.
        noise, resolution: of native channels, if stated in the file.
        unnamed: why the file has no `time` although it has instants, as the end of a sentence that begins
            with the file's name, without its full stop.
        objects: variables that only the program that wrote them can open, with instructions for it.
    """

    source: str
    variables: Mapping[str, NDArray[Any]]
    names: tuple[str, ...]
    first_row: int = 1
    noise: Mapping[str, float] = field(default_factory=dict)
    resolution: Mapping[str, float] = field(default_factory=dict)
    unnamed: str = ""
    objects: Mapping[str, str] = field(default_factory=dict)

    def __getitem__(self, name: str) -> NDArray[Any]:
        try:
            return self.variables[name]
        except KeyError:
            raise InputError(f"{self.source} has no variable '{name}'{self.hint(name)}") from None

    def hint(self, name: str) -> str:
        """The most similar name in the file, or the existing names, as the end of a sentence."""
        first = name.split(".")[0].split("{")[0]
        closed = first if first in self.objects else "" if self.names else next(iter(self.objects), "")
        if closed:
            return f": {closed} is {self.objects[closed]}."
        shown = ", ".join(self.names[:SHOWN_NAMES]) + (", ..." if len(self.names) > SHOWN_NAMES else "")
        return nearest(name, self.names) or (f"; it has {shown}." if shown else "; it has no variables.")

    def numbers(self, name: str, *, column: str | None = None, needed: bool = False) -> NDArray[np.float64]:
        """The variable as float64, in its own shape; None, empty cells and such become NaN.

        Args:
            name: the variable.
            column: its name in errors, if different.
            needed: whether every row must have it, such as its instant.

        Raises:
            InputError: no such variable, or text where numbers are expected (with the row).
        """
        values = self[name]
        if values.dtype.kind in "biuf":
            return np.asarray(values, dtype=np.float64)
        if values.dtype.kind in "SUO":
            return self._parsed(
                values, column or name, "remove the row" if needed else "leave the cell empty"
            )
        what = "instants" if values.dtype.kind == "M" else f"values of type {values.dtype}"
        raise InputError(f"{column or name} of {self.source} holds {what} where numbers are expected.")

    def _parsed(self, values: NDArray[Any], column: str, instead: str) -> NDArray[np.float64]:
        numbers = np.empty(values.shape, dtype=np.float64)
        for row, value in enumerate(values.flat):
            try:
                numbers.flat[row] = _number(value)
            except (TypeError, ValueError, OverflowError):
                raise InputError(
                    f"{self.source} has {_shown(value)} where a number is expected, in column '{column}', "
                    f"row {row + self.first_row}; correct it or {instead}."
                ) from None
        return numbers


def _number(value: Any) -> float:
    if value is None:
        return float("nan")
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str):
        return float(value) if value.strip() else float("nan")
    return float(value)


def _shown(value: Any) -> str:
    text = repr(value.item() if isinstance(value, np.generic) else value)
    return text if len(text) <= 30 else text[:27] + "..."
