"""HDF5: datasets of numbers, those in groups with dots (``log/q`` is ``log.q``)."""

from __future__ import annotations

from missing_physics.recordings.channels.raw import Raw, Want
from missing_physics.recordings.readers.hdf5.datasets import is_hdf5, read_datasets
from missing_physics.recordings.readers.source import Source

__all__ = ["SUFFIXES", "is_hdf5", "read", "read_datasets"]

SUFFIXES = (".h5", ".hdf5", ".hdf")


def read(source: Source, *, want: Want) -> Raw:
    """The datasets of an HDF5 file. Raises `InputError` when it is truncated or damaged."""
    return read_datasets(source, want=want, kind="HDF5", by_columns=False)
