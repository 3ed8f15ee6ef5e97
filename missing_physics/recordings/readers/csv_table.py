"""CSV: a header row, then one row per sample; comma, semicolon, tab or spaces between cells."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa
import pyarrow.csv as pa_csv

from missing_physics.recordings.raw import Raw, Want
from missing_physics.recordings.readers.base import LONGEST_REASON, reading
from missing_physics.recordings.readers.columns import table_variables
from robot_model import InputError

__all__ = ["SUFFIXES", "read"]

SUFFIXES = (".csv", ".tsv", ".txt")

_DELIMITERS = ",;\t"
_COMMENT = ("#", "%")
_DECIMAL_COMMA = re.compile(r"(^|[;\t ])\s*[-+]?\d+,\d+")
_SPACES, _ENDS = re.compile(rb" {2,}"), re.compile(rb"^ | (?=\r?$)", re.MULTILINE)
#: Name of the empty column behind a delimiter that ends every row; no column of a file can be called so.
_NOTHING = "\0"
#: Bytes at the start of the file in which the header and the first row must lie.
_HEAD = 1 << 16


@dataclass(frozen=True)
class _Form:
    """How a text file is laid out.

    Attributes:
        names: of its columns.
        skipped: lines before the first row of numbers.
        delimiter: between cells; a space stands for any run of spaces.
        decimal: point or comma.
        trailing: every row ends with a delimiter.
    """

    names: tuple[str, ...]
    skipped: int
    delimiter: str
    decimal: str
    trailing: bool


def read(path: Path, *, want: Want, skip_lines: int = 0) -> Raw:
    """The columns of a CSV file.

    Lines before the header that start with ``#`` or ``%`` are skipped. A file whose first row holds
    numbers has no header: its columns are called ``column1``, ``column2``, ... With semicolons, tabs or
    spaces a decimal comma is understood. A delimiter at the end of every row makes no column.

    Args:
        path: the file.
        want: which columns to read, by name.
        skip_lines: lines before the table that belong to nothing in it.

    Raises:
        InputError: no rows, a row with another number of cells, bytes that are not text.
    """
    with reading(path, "CSV"):
        form = _form(path, skip_lines)
        table = _table(path, form, want=want)
        if table.num_columns and not table.num_rows:
            raise InputError(f"{path} has a header but no rows; record or export it again.")
        return Raw(str(path), table_variables(table), form.names, first_row=1 + form.skipped)


def _form(path: Path, skip_lines: int) -> _Form:
    """From the header, or the first row, and the row below it."""
    skipped, header, first = _head(path, skip_lines)
    delimiter = max(_DELIMITERS, key=header.count)
    spaced = delimiter not in header and len(header.split()) == len(first.split()) > 1
    cells = header.split() if spaced else header.split(delimiter)
    cells = [cell.strip().strip('"').strip() for cell in cells]
    named = cells[:-1] if not cells[-1] else cells
    trailing = first.rstrip(" ").endswith(delimiter) and first.count(delimiter) == len(named)
    cells = named if trailing else cells
    headless = all(_is_number(cell) for cell in cells)
    names = tuple(f"column{i + 1}" for i in range(len(cells))) if headless else tuple(cells)
    _check_names(path, names)
    return _Form(
        names=names,
        skipped=skipped + (not headless),
        delimiter=" " if spaced else delimiter,
        decimal="," if delimiter != "," and _DECIMAL_COMMA.search(first) else ".",
        trailing=trailing,
    )


def _head(path: Path, skip_lines: int) -> tuple[int, str, str]:
    """Number of lines before the header line, that line and the first row below it."""
    with path.open("rb") as file:
        block = file.read(_HEAD)
    if b"\0" in block:
        raise InputError(f"{path} holds binary data, not text; give the file its own suffix.")
    lines = block.decode("utf-8-sig", "replace").splitlines()
    skipped = skip_lines
    while skipped < len(lines) and lines[skipped].startswith(_COMMENT):
        skipped += 1
    while skipped < len(lines) and not lines[skipped].strip():
        skipped += 1
    if skipped >= len(lines):
        raise InputError(f"{path} holds no table; a header row and rows of numbers are due.")
    return skipped, lines[skipped], lines[skipped + 1] if skipped + 1 < len(lines) else ""


def _check_names(path: Path, names: tuple[str, ...]) -> None:
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError(f"{path} has two columns called '{name}'; rename one of them.")


def _table(path: Path, form: _Form, *, want: Want) -> pa.Table:
    wanted = [name for name in form.names if want(name)]
    if not wanted:
        return pa.table({})
    names = [*form.names, _NOTHING] if form.trailing else list(form.names)
    try:
        return pa_csv.read_csv(
            _one_space(path) if form.delimiter == " " else path,
            read_options=pa_csv.ReadOptions(column_names=names, skip_rows=form.skipped),
            parse_options=pa_csv.ParseOptions(delimiter=form.delimiter),
            convert_options=pa_csv.ConvertOptions(
                include_columns=wanted, decimal_point=form.decimal, strings_can_be_null=True
            ),
        )
    except pa.ArrowInvalid as error:
        _refuse_ragged(path, form, cells=len(names))
        reason = " ".join(str(error).split())[:LONGEST_REASON]
        raise InputError(f"{path} is not a table of numbers ({reason.rstrip('.')}).") from None


def _one_space(path: Path) -> BinaryIO:
    """The text with one space where there are several, and none at the ends of lines."""
    return BytesIO(_ENDS.sub(b"", _SPACES.sub(b" ", path.read_bytes())))


def _refuse_ragged(path: Path, form: _Form, *, cells: int) -> None:
    """Name the first row with another number of cells; Arrow reads in parallel and does not know it."""
    with path.open("r", encoding="utf-8-sig", errors="replace", newline="") as file:
        spaced = form.delimiter == " "
        rows = csv.reader(file, delimiter=form.delimiter, skipinitialspace=spaced)
        for row in rows:
            found = len(row) - (spaced and row[-1:] == [""])
            if rows.line_num > form.skipped and row and found != cells:
                raise InputError(
                    f"{path} has {found} cells in row {rows.line_num} where {cells} are due; "
                    "complete the row or remove it (a last row that is cut off means a truncated file)."
                )


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
