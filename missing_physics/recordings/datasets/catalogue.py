"""The datasets that are known by repository, commit and checksum; `catalogue.toml` lists them."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from types import MappingProxyType
from typing import Any, Literal
from urllib.parse import quote

__all__ = ["DATASETS", "DataFile", "Dataset", "Layout"]

_HOST = "https://raw.githubusercontent.com"

#: `published`: files as their authors publish them. `prepared`: the same recordings in files of another
#: layout (several files joined, rows decimated), which can be passed on but not downloaded.
Layout = Literal["published", "prepared"]


@dataclass(frozen=True)
class DataFile:
    """One file of a dataset.

    Attributes:
        name: its name here, relative to the dataset's folder.
        sha256: of the published file, or of the prepared one.
        path: in the public repository; empty for a prepared file, which is not there.
        commit: of the repository, if different from the dataset's.
        copies: SHA-256 of copies with fewer columns or digits, which can be read with the same map.
        layout: the only layout that it belongs to; None for all.
    """

    name: str
    sha256: str
    path: str = ""
    commit: str = ""
    copies: tuple[str, ...] = ()
    layout: Layout | None = None

    @property
    def accepted(self) -> tuple[str, ...]:
        """Every SHA-256 that this file may have."""
        return (self.sha256, *self.copies)


@dataclass(frozen=True)
class Dataset:
    """Public recordings of one real machine, pinned to a commit.

    Attributes:
        name: key of `DATASETS`, and name of its folder.
        what: the machine and its recordings, in one line.
        repository: OWNER/NAME on GitHub.
        commit: of the repository, 40 hexadecimal digits.
        licence: of the recordings.
        citation: requested by the authors, or their names.
        files: recordings and robot descriptions, of all layouts.
    """

    name: str
    what: str
    repository: str
    commit: str
    licence: str
    citation: str
    files: tuple[DataFile, ...]

    def url(self, file: DataFile) -> str:
        """Download address of a published file."""
        return f"{_HOST}/{self.repository}/{file.commit or self.commit}/{quote(file.path)}"

    @property
    def layouts(self) -> tuple[Layout, ...]:
        """The layouts in which the dataset exists, the published one first."""
        has_prepared = any(file.layout == "prepared" for file in self.files)
        return ("published", "prepared") if has_prepared else ("published",)

    def in_layout(self, layout: Layout) -> tuple[DataFile, ...]:
        """The files that make up one layout."""
        return tuple(file for file in self.files if file.layout in (None, layout))


def _dataset(name: str, entry: Mapping[str, Any]) -> Dataset:
    listed = tuple(DataFile(**{**file, "copies": tuple(file.get("copies", ()))}) for file in entry["files"])
    return Dataset(name=name, **{**entry, "files": listed})


def _catalogue() -> Mapping[str, Dataset]:
    text = files(__package__).joinpath("catalogue.toml").read_text("utf-8")
    return MappingProxyType({name: _dataset(name, entry) for name, entry in tomllib.loads(text).items()})


#: Name to dataset.
DATASETS: Mapping[str, Dataset] = _catalogue()
