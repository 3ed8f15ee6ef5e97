"""Parquet: one column per variable; noise and resolution of native channels in the file's metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pyarrow.parquet as pq

from missing_physics.recordings.raw import Raw, Want
from missing_physics.recordings.readers.base import reading
from missing_physics.recordings.readers.columns import table_variables
from robot_model import InputError

__all__ = ["METADATA_KEY", "SUFFIXES", "read"]

SUFFIXES = (".parquet", ".pq")

#: Key of the file's metadata under which a JSON object {"noise": {...}, "resolution": {...}} is kept.
METADATA_KEY = b"missing_physics"


def read(path: Path, *, want: Want) -> Raw:
    """The columns of a Parquet file. Raises `InputError` when it is truncated or damaged."""
    with reading(path, "Parquet"), pq.ParquetFile(path) as file:
        names = tuple(file.schema_arrow.names)
        table = file.read(columns=[name for name in names if want(name)])
        known = _metadata(path, file.schema_arrow.metadata or {})
        return Raw(
            str(path), table_variables(table), names, noise=known["noise"], resolution=known["resolution"]
        )


def _metadata(path: Path, metadata: Mapping[bytes, bytes]) -> dict[str, dict[str, float]]:
    data = json.loads(metadata.get(METADATA_KEY, b"{}"))
    try:
        return {
            kind: {str(name): float(value) for name, value in data.get(kind, {}).items()}
            for kind in ("noise", "resolution")
        }
    except (AttributeError, TypeError, ValueError):
        raise InputError(f"{path} has damaged metadata '{METADATA_KEY.decode()}'; write it again.") from None
