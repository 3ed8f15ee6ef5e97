"""CSV: a header row, then one row per sample; comma, semicolon or tab between cells."""

from __future__ import annotations

import csv
import re
from pathlib import Path

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
_DECIMAL_COMMA = re.compile(r"(^|[;\t])\s*[-+]?\d+,\d+")
#: Bytes at the start of the file in which the header and the first row must lie.
_HEAD = 1 << 16


def read(path: Path, *, want: Want) -> Raw:
    """The columns of a CSV file.

    Lines before the header that start with ``#`` or ``%`` are skipped. A file whose first row holds
    numbers has no header: its columns are called ``column1``, ``column2``, ... With semicolons or tabs a
    decimal comma is understood.

    Raises:
        InputError: no rows, a row with another number of cells, bytes that are not text.
    """
    with reading(path, "CSV"):
        skipped, header, first = _head(path)
        delimiter = max(_DELIMITERS, key=header.count)
        cells = [cell.strip().strip('"').strip() for cell in header.split(delimiter)]
        headless = all(_is_number(cell) for cell in cells)
        names = [f"column{i + 1}" for i in range(len(cells))] if headless else cells
        _check_names(path, names)
        decimal = "," if delimiter != "," and _DECIMAL_COMMA.search(first) else "."
        table = _table(
            path,
            skipped=skipped + (not headless),
            names=names,
            delimiter=delimiter,
            decimal=decimal,
            want=want,
        )
        first_row = 1 + skipped + (not headless)
        if table.num_columns and not table.num_rows:
            raise InputError(f"{path} has a header but no rows; record or export it again.")
        return Raw(str(path), table_variables(table), tuple(names), first_row=first_row)


def _head(path: Path) -> tuple[int, str, str]:
    """Number of comment lines, the header line and the first row below it."""
    with path.open("rb") as file:
        block = file.read(_HEAD)
    if b"\0" in block:
        raise InputError(f"{path} holds binary data, not text; give the file its own suffix.")
    lines = block.decode("utf-8-sig", "replace").splitlines()
    skipped = 0
    while skipped < len(lines) and lines[skipped].startswith(_COMMENT):
        skipped += 1
    while skipped < len(lines) and not lines[skipped].strip():
        skipped += 1
    if skipped >= len(lines):
        raise InputError(f"{path} holds no table; a header row and rows of numbers are due.")
    return skipped, lines[skipped], lines[skipped + 1] if skipped + 1 < len(lines) else ""


def _check_names(path: Path, names: list[str]) -> None:
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError(f"{path} has two columns called '{name}'; rename one of them.")


def _table(
    path: Path, *, skipped: int, names: list[str], delimiter: str, decimal: str, want: Want
) -> pa.Table:
    wanted = [name for name in names if want(name)]
    if not wanted:
        return pa.table({})
    try:
        return pa_csv.read_csv(
            path,
            read_options=pa_csv.ReadOptions(column_names=names, skip_rows=skipped),
            parse_options=pa_csv.ParseOptions(delimiter=delimiter),
            convert_options=pa_csv.ConvertOptions(
                include_columns=wanted, decimal_point=decimal, strings_can_be_null=True
            ),
        )
    except pa.ArrowInvalid as error:
        _refuse_ragged(path, skipped=skipped, cells=len(names), delimiter=delimiter)
        reason = " ".join(str(error).split())[:LONGEST_REASON]
        raise InputError(f"{path} is not a table of numbers ({reason.rstrip('.')}).") from None


def _refuse_ragged(path: Path, *, skipped: int, cells: int, delimiter: str) -> None:
    """Name the first row with another number of cells; Arrow reads in parallel and does not know it."""
    with path.open("r", encoding="utf-8-sig", errors="replace", newline="") as file:
        rows = csv.reader(file, delimiter=delimiter)
        for row in rows:
            if rows.line_num > skipped and row and len(row) != cells:
                raise InputError(
                    f"{path} has {len(row)} cells in row {rows.line_num} where {cells} are due; "
                    "complete the row or remove it (a last row that is cut off means a truncated file)."
                )


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
