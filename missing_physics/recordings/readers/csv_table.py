"""CSV: a header row, then one row per sample; comma, semicolon, tab or spaces between cells."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO, TextIO

import pyarrow as pa
import pyarrow.csv as pa_csv

from missing_physics.recordings.channels.raw import Raw, Want
from missing_physics.recordings.readers.base import LONGEST_REASON, reading
from missing_physics.recordings.readers.budget import NUMBER
from missing_physics.recordings.readers.columns import table_variables
from missing_physics.recordings.readers.source import Source
from robot_model import InputError

__all__ = ["SUFFIXES", "read"]

SUFFIXES = (".csv", ".tsv", ".txt", ".dat")

_DELIMITERS = ",;\t"
_COMMENT = ("#", "%")
_DECIMAL_COMMA = re.compile(r"(^|[;\t ])\s*[-+]?\d+,\d+")
_SPACES, _ENDS = re.compile(rb" {2,}"), re.compile(rb"^ | (?=\r?$)", re.MULTILINE)
#: Name of the empty column after a delimiter at the end of every row; no column of a file can have it.
_NOTHING = "\0"
#: Bytes at the start of the file that distinguish text from binary data.
_HEAD = 1 << 16
#: Most characters of a line: a million columns with names of usual length.
LONGEST_LINE = 1 << 24
#: Bytes that are searched for line ends at once.
_BLOCK = 1 << 22


@dataclass(frozen=True)
class _Form:
    """Layout of a text file.

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


def read(source: Source, *, want: Want, skip_lines: int = 0) -> Raw:
    """The columns of a CSV file.

    Lines before the header that start with ``#`` or ``%`` are skipped. A file whose first row holds
    numbers has no header: its columns are called ``column1``, ``column2``, ... With semicolons, tabs or
    spaces a decimal comma is understood. A delimiter at the end of every row makes no column.

    Args:
        source: the file.
        want: which columns to read, by name.
        skip_lines: number of lines before the table.

    Raises:
        InputError: no rows, a row with another number of cells, bytes that are not text.
    """
    with reading(source, "CSV"):
        form = _form(source, skip_lines)
        table = _table(source, form, want=want)
        if table.num_columns and not table.num_rows:
            raise InputError(f"{source} has a header but no rows; record or export it again.")
        found = table_variables(table, source)
        return Raw(source.name, found, form.names, first_row=1 + form.skipped)


def _form(source: Source, skip_lines: int) -> _Form:
    """The layout, from the header or the first row, and the row below it."""
    skipped, header, first = _head(source, skip_lines)
    delimiter = max(_DELIMITERS, key=header.count)
    spaced = delimiter not in header and len(header.split()) == len(first.split()) > 1
    cells = header.split() if spaced else header.split(delimiter)
    cells = [cell.strip().strip('"').strip() for cell in cells]
    named = cells[:-1] if not cells[-1] else cells
    trailing = first.rstrip(" ").endswith(delimiter) and first.count(delimiter) == len(named)
    cells = named if trailing else cells
    headless = all(_is_number(cell) for cell in cells)
    names = tuple(f"column{i + 1}" for i in range(len(cells))) if headless else tuple(cells)
    _check_names(source, names)
    return _Form(
        names=names,
        skipped=skipped + (not headless),
        delimiter=" " if spaced else delimiter,
        decimal="," if delimiter != "," and _DECIMAL_COMMA.search(first) else ".",
        trailing=trailing,
    )


def _head(source: Source, skip_lines: int) -> tuple[int, str, str]:
    """Number of lines before the header line, that line and the first row below it."""
    with source.path.open("rb") as file:
        if b"\0" in file.read(_HEAD):
            raise InputError(f"{source} holds binary data, not text; give the file its own suffix.")
    with source.path.open("r", encoding="utf-8-sig", errors="replace") as text:
        for _ in range(skip_lines):
            _line(source, text)
        skipped, line = skip_lines, _line(source, text)
        while line.startswith(_COMMENT):
            skipped, line = skipped + 1, _line(source, text)
        while line and not line.strip():
            skipped, line = skipped + 1, _line(source, text)
        if not line:
            raise InputError(f"{source} holds no table; a header row and rows of numbers are expected.")
        return skipped, line.rstrip("\n"), _line(source, text).rstrip("\n")


def _line(source: Source, text: TextIO) -> str:
    """The next line, empty at the end."""
    line = text.readline(LONGEST_LINE)
    if len(line) == LONGEST_LINE:
        raise InputError(
            f"{source} has a line of more than {LONGEST_LINE / 1e6:.0f} million characters, which is no row "
            "of a table; give one row per sample."
        )
    return line


def _check_names(source: Source, names: tuple[str, ...]) -> None:
    known: set[str] = set()
    for name in names:
        if name in known:
            raise InputError(f"{source} has two columns called '{name}'; rename one of them.")
        known.add(name)


def _table(source: Source, form: _Form, *, want: Want) -> pa.Table:
    wanted = [name for name in form.names if want(name)]
    if not wanted:
        return pa.table({})
    rows = _line_ends(source)
    source.budget.take(
        rows * len(wanted) * NUMBER, f"{source} holds {rows} rows x {len(wanted)} columns that are read"
    )
    names = [*form.names, _NOTHING] if form.trailing else list(form.names)
    try:
        return pa_csv.read_csv(
            _one_space(source) if form.delimiter == " " else source.path,
            read_options=pa_csv.ReadOptions(column_names=names, skip_rows=form.skipped),
            parse_options=pa_csv.ParseOptions(delimiter=form.delimiter),
            convert_options=pa_csv.ConvertOptions(
                include_columns=wanted, decimal_point=form.decimal, strings_can_be_null=True
            ),
        )
    except pa.ArrowInvalid as error:
        _refuse_ragged(source, form, cells=len(names))
        reason = " ".join(str(error).split())[:LONGEST_REASON]
        raise InputError(f"{source} is not a table of numbers ({reason.rstrip('.')}).") from None


def _line_ends(source: Source) -> int:
    """Largest possible number of rows of the text."""
    feeds = returns = 0
    with source.path.open("rb") as file:
        while block := file.read(_BLOCK):
            feeds, returns = feeds + block.count(b"\n"), returns + block.count(b"\r")
    return max(feeds, returns) + 1


def _one_space(source: Source) -> BinaryIO:
    """The text with one space where there are several, and none at the ends of lines."""
    source.budget.take(2 * source.path.stat().st_size, f"{source} holds text with spaces between cells")
    return BytesIO(_ENDS.sub(b"", _SPACES.sub(b" ", source.path.read_bytes())))


def _refuse_ragged(source: Source, form: _Form, *, cells: int) -> None:
    """Report the first row with a different number of cells, which Arrow does not know."""
    with source.path.open("r", encoding="utf-8-sig", errors="replace", newline="") as file:
        spaced = form.delimiter == " "
        rows = csv.reader(file, delimiter=form.delimiter, skipinitialspace=spaced)
        for row in rows:
            found = len(row) - (spaced and row[-1:] == [""])
            if rows.line_num > form.skipped and row and found != cells:
                raise InputError(
                    f"{source} has {found} cells in row {rows.line_num} where {cells} are expected; "
                    "complete the row or remove it (a last row that is cut off means a truncated file)."
                )


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
