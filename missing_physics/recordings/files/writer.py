"""Writing a recording so that reading it back gives the same numbers."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from missing_physics.recordings.readers.npz import NOISE, RESOLUTION
from missing_physics.recordings.readers.parquet import METADATA_KEY
from robot_model import InputError, Recording, replacing

__all__ = ["write_recording"]


def write_recording(recording: Recording, path: str | os.PathLike[str]) -> None:
    """Write `recording` atomically; the suffix gives the format (``.csv``, ``.parquet``, ``.npz``).

    Numbers keep all their digits. Noise and resolution are kept in Parquet and NPZ, not in CSV.

    Raises:
        InputError: another suffix, or a folder that cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _WRITERS:
        known = ", ".join(_WRITERS)
        raise InputError(f"{path} has the suffix '{suffix}'; a recording can be written as {known}.")
    with replacing(path) as temporary:
        _WRITERS[suffix](recording, temporary)


def _table(recording: Recording) -> pa.Table:
    columns = {"time": recording.time, **recording.channels}
    known = {"noise": dict(recording.noise), "resolution": dict(recording.resolution)}
    return pa.table(columns).replace_schema_metadata({METADATA_KEY: json.dumps(known)})


def _write_csv(recording: Recording, path: Path) -> None:
    # Arrow prints the shortest text that reads back as the same float64.
    pa_csv.write_csv(_table(recording), path, pa_csv.WriteOptions(quoting_style="needed"))


def _write_parquet(recording: Recording, path: Path) -> None:
    pq.write_table(_table(recording), path, compression="zstd", use_dictionary=False)


def _write_npz(recording: Recording, path: Path) -> None:
    arrays: dict[str, np.ndarray] = {"time": recording.time, **recording.channels}
    arrays |= {NOISE + name: np.array(value) for name, value in recording.noise.items()}
    arrays |= {RESOLUTION + name: np.array(value) for name, value in recording.resolution.items()}
    np.savez_compressed(path, allow_pickle=False, **arrays)


_WRITERS: Mapping[str, Callable[[Recording, Path], None]] = MappingProxyType(
    {".csv": _write_csv, ".parquet": _write_parquet, ".npz": _write_npz}
)
