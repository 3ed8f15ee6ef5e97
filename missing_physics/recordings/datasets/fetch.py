"""The files of a dataset: from a folder of the user's, or downloaded; every checksum is verified."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pooch

from missing_physics.recordings.datasets.catalogue import DATASETS, DataFile, Dataset
from robot_model import InputError, nearest

__all__ = [
    "CACHE_VARIABLE",
    "DATA_VARIABLE",
    "dataset_files",
    "fetch_dataset",
    "find_dataset",
    "local_folder",
]

#: Environment variable that names a folder with datasets, `FOLDER/NAME/FILE`, which is searched first.
DATA_VARIABLE = "MISSING_PHYSICS_DATA"
#: Overrides pooch's own choice of the user's cache folder.
CACHE_VARIABLE = "MISSING_PHYSICS_CACHE"


def fetch_dataset(name: str, *, downloader: Callable[..., Any] | None = None, progress: bool = False) -> Path:
    """The folder with all files of a dataset; missing files are downloaded into the user's cache.

    Args:
        name: a key of `DATASETS`.
        downloader: called as ``downloader(url, output_file, pooch)`` instead of an HTTP download.
        progress: show a progress bar on stderr.

    Raises:
        InputError: unknown name, wrong checksum, no network.
    """
    dataset = _known(name)
    local = local_folder(name)
    if local is not None:
        return local
    folder = _cache(name)
    for file in dataset.in_layout("published"):
        _download(dataset, file, folder, downloader=downloader, progress=progress)
    return folder


def find_dataset(name: str) -> Path | None:
    """The dataset's folder on this machine, in the user's folder or in the cache; None if it is in neither.

    Raises:
        InputError: unknown name, or a file there that is neither the published one nor a known copy.
    """
    folder = local_folder(name)
    if folder is None and dataset_files(name, _cache(name)):
        return fetch_dataset(name)  # verifies; only a damaged file would be downloaded again
    return folder


def local_folder(name: str) -> Path | None:
    """The dataset's folder under `MISSING_PHYSICS_DATA`, with every checksum verified; None if incomplete.

    Raises:
        InputError: unknown name, or a file there that is neither the published one nor a known copy.
    """
    _known(name)
    root = os.environ.get(DATA_VARIABLE)
    if not root:
        return None
    folder = Path(root) / name
    for file in dataset_files(name, folder):
        if _sha256(folder / file.name) not in file.accepted:
            raise InputError(
                f"{folder / file.name} is not the published file, nor a known copy of it (its SHA-256 "
                f"differs); replace it, or unset {DATA_VARIABLE} to download it."
            )
    return folder if dataset_files(name, folder) else None


def dataset_files(name: str, folder: Path) -> tuple[DataFile, ...]:
    """The files of the first layout of the dataset that is complete in `folder`; empty if none is."""
    dataset = _known(name)
    for layout in dataset.layouts:
        listed = dataset.in_layout(layout)
        if all((folder / file.name).is_file() for file in listed):
            return listed
    return ()


def _cache(name: str) -> Path:
    return Path(os.environ.get(CACHE_VARIABLE) or pooch.os_cache("missing-physics")) / name


def _known(name: str) -> Dataset:
    if name not in DATASETS:
        known = ", ".join(DATASETS)
        raise InputError(f"there is no dataset '{name}'{nearest(name, DATASETS) or f'; there are {known}.'}")
    return DATASETS[name]


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _download(
    dataset: Dataset,
    file: DataFile,
    folder: Path,
    *,
    downloader: Callable[..., Any] | None,
    progress: bool,
) -> None:
    """Download into `folder`; pooch verifies the checksum before renaming the file."""
    target = folder / file.name
    try:
        pooch.retrieve(
            dataset.url(file),
            known_hash=f"sha256:{file.sha256}",
            fname=target.name,
            path=target.parent,
            downloader=downloader,
            progressbar=progress and downloader is None,
        )
    except ValueError:
        raise InputError(
            f"{dataset.url(file)} did not give the published file (its SHA-256 differs); try again later."
        ) from None
    except OSError as error:  # requests' own errors derive from OSError too
        reason = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise InputError(
            f"{dataset.url(file)} cannot be downloaded ({reason}); check the network, or put the file into "
            f"FOLDER/{dataset.name}/{file.name} and set {DATA_VARIABLE}=FOLDER."
        ) from None
