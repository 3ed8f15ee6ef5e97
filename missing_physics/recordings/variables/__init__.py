"""From the variables of a file to sample instants and numbers, by the entries of a mapping."""

from missing_physics.recordings.variables.columns import column, parts
from missing_physics.recordings.variables.instants import MIN_SAMPLES, check_time, instants, record_rows
from missing_physics.recordings.variables.picks import one_dimension, picked

__all__ = [
    "MIN_SAMPLES",
    "check_time",
    "column",
    "instants",
    "one_dimension",
    "parts",
    "picked",
    "record_rows",
]
