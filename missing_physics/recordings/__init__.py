"""Recordings: a reader per format, mapping files, checks and writing."""

from missing_physics.recordings.load import load_constants, load_recording
from missing_physics.recordings.mapping import Mapping, load_mapping, mapping_from_toml
from missing_physics.recordings.readers import READERS, read_raw

__all__ = [
    "READERS",
    "Mapping",
    "load_constants",
    "load_mapping",
    "load_recording",
    "mapping_from_toml",
    "read_raw",
]
