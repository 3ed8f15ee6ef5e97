"""Public recordings of real machines: their sources, by commit and checksum, and download."""

from missing_physics.recordings.datasets.catalogue import DATASETS, DataFile, Dataset
from missing_physics.recordings.datasets.fetch import (
    DATA_VARIABLE,
    dataset_files,
    fetch_dataset,
    find_dataset,
    local_folder,
)

__all__ = [
    "DATASETS",
    "DATA_VARIABLE",
    "DataFile",
    "Dataset",
    "dataset_files",
    "fetch_dataset",
    "find_dataset",
    "local_folder",
]
