"""Recordings: one reader per format, mapping files, checks and writing."""

from missing_physics.recordings.channels.decimation import PASSES, decimated, decimation_of
from missing_physics.recordings.channels.estimates import (
    estimate_noise,
    estimate_resolution,
    noise_of,
    rests_on_levels,
    sample_time_of,
)
from missing_physics.recordings.channels.raw import Raw
from missing_physics.recordings.channels.sensors import sensor_of, sensors_of, with_sensors
from missing_physics.recordings.files.load import (
    load_constants,
    load_recording,
    load_recording_and_constants,
    own_mapping,
    recording_from_table,
    recording_of_raw,
)
from missing_physics.recordings.files.writer import write_recording
from missing_physics.recordings.inspection.consistency import (
    consistency_findings,
    require_consistent,
    sentence_of,
)
from missing_physics.recordings.inspection.excitation import Excitation, excitation
from missing_physics.recordings.inspection.findings import Finding
from missing_physics.recordings.inspection.gathered import check
from missing_physics.recordings.inspection.outlook import outlook
from missing_physics.recordings.inspection.shares import percent
from missing_physics.recordings.inspection.units import position_per_velocity, unit_findings
from missing_physics.recordings.maps.conversion import conversion as unit_conversion
from missing_physics.recordings.maps.corrections import Correction, corrected, corrected_map, in_words
from missing_physics.recordings.maps.mapping import Mapping, load_mapping, mapping_from_toml
from missing_physics.recordings.readers import READERS, SIZE_LIMIT, Budget, read_raw

__all__ = [
    "PASSES",
    "READERS",
    "SIZE_LIMIT",
    "Budget",
    "Correction",
    "Excitation",
    "Finding",
    "Mapping",
    "Raw",
    "check",
    "consistency_findings",
    "corrected",
    "corrected_map",
    "decimated",
    "decimation_of",
    "estimate_noise",
    "estimate_resolution",
    "excitation",
    "in_words",
    "load_constants",
    "load_mapping",
    "load_recording",
    "load_recording_and_constants",
    "mapping_from_toml",
    "noise_of",
    "outlook",
    "own_mapping",
    "percent",
    "position_per_velocity",
    "read_raw",
    "recording_from_table",
    "recording_of_raw",
    "require_consistent",
    "rests_on_levels",
    "sample_time_of",
    "sensor_of",
    "sensors_of",
    "sentence_of",
    "unit_conversion",
    "unit_findings",
    "with_sensors",
    "write_recording",
]
