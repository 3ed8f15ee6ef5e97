"""Parquet: one column per variable; noise and resolution of native channels in the file's metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import pyarrow as pa
import pyarrow.parquet as pq

from missing_physics.recordings.channels.raw import Raw, Want
from missing_physics.recordings.readers.base import reading
from missing_physics.recordings.readers.budget import NUMBER
from missing_physics.recordings.readers.columns import is_list, is_read, is_text, table_variables
from missing_physics.recordings.readers.source import Source
from robot_model import InputError

__all__ = ["METADATA_KEY", "SUFFIXES", "read"]

SUFFIXES = (".parquet", ".pq")

#: Key of the file's metadata under which a JSON object {"noise": {...}, "resolution": {...}} is kept.
METADATA_KEY = b"missing_physics"


def read(source: Source, *, want: Want) -> Raw:
    """The columns of a Parquet file. Raises `InputError` when it is truncated or damaged."""
    with reading(source, "Parquet"), pq.ParquetFile(source.path) as head:
        schema = head.schema_arrow
        wanted = [field for field in schema if want(field.name) and is_read(field.type)]
        _check_size(source, head.metadata, wanted)
        known = _metadata(source, schema.metadata or {})
        # Text is read as a dictionary, since a dictionary of a page may stand for any number of rows.
        text = [field.name for field in wanted if is_text(field.type)]
        with pq.ParquetFile(source.path, read_dictionary=text) as file:
            table = file.read(columns=[field.name for field in wanted])
        return Raw(
            source.name,
            table_variables(table, source),
            tuple(schema.names),
            noise=known["noise"],
            resolution=known["resolution"],
        )


def _check_size(source: Source, metadata: pq.FileMetaData, wanted: Sequence[pa.Field]) -> None:
    """Take the memory that the file's footer declares from the budget: values, since runs of equal ones need
    hardly any bytes, and bytes, since compression may reduce them a thousandfold."""
    groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
    rows = max(metadata.num_rows, sum(group.num_rows for group in groups))
    plain = [field for field in wanted if not is_list(field.type)]
    listed = _entries(metadata, {field.name for field in wanted if is_list(field.type)})
    size = (rows * len(plain) + listed) * NUMBER
    if any(is_text(field.type) for field in wanted):
        size += sum(group.total_byte_size for group in groups)
    source.budget.take(size, _declared(source, rows, len(plain), listed))


def _declared(source: Source, rows: int, columns: int, listed: int) -> str:
    words = [f"{rows} rows x {columns} columns"] * bool(columns) + [f"{listed} numbers in lists"] * bool(
        listed
    )
    return f"{source} declares {' and '.join(words) or 'nothing'}"


def _entries(metadata: pq.FileMetaData, names: set[str]) -> int:
    """Numbers in columns of lists, rows without a list counted as one."""
    total = 0
    for i in range(metadata.num_row_groups):
        group = metadata.row_group(i)
        for j in range(group.num_columns):
            column = group.column(j)
            if any(column.path_in_schema.startswith(f"{name}.") for name in names):
                total += column.num_values
    return total


def _metadata(source: Source, metadata: Mapping[bytes, bytes]) -> dict[str, dict[str, float]]:
    data = json.loads(metadata.get(METADATA_KEY, b"{}"))
    try:
        return {
            kind: {str(name): float(value) for name, value in data.get(kind, {}).items()}
            for kind in ("noise", "resolution")
        }
    except (AttributeError, TypeError, ValueError, OverflowError):
        raise InputError(
            f"{source} has damaged metadata '{METADATA_KEY.decode()}'; write it again."
        ) from None
