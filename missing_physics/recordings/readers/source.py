"""Input of a reader: a seekable file, and its displayed name."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from missing_physics.recordings.readers.budget import Budget
from robot_model import InputError

__all__ = ["Source", "opened"]

#: Bytes that are copied from a pipe at once.
BLOCK = 1 << 20
#: Suffix of a pipe whose name has none, such as /dev/stdin.
PIPED = ".csv"
#: File that marks a folder as a bag of ROS 2.
BAG_FILE = "metadata.yaml"
#: Open files by number: on some systems all openings of one share a position.
DESCRIPTORS = ("/dev/stdin", "/dev/fd/", "/proc/self/fd/")


@dataclass(frozen=True)
class Source:
    """A file to read.

    Attributes:
        path: of the file; of a copy of a pipe's content; of the folder of a ROS 2 bag.
        name: displayed name.
        suffix: in lower case, with its dot.
        budget: memory for its variables.
    """

    path: Path
    name: str
    suffix: str
    budget: Budget

    def __str__(self) -> str:
        return self.name


@contextmanager
def opened(path: str | os.PathLike[str], budget: Budget) -> Iterator[Source]:
    """The file itself; for a pipe or device, a copy that exists during the block.

    Raises:
        InputError: no such file, a folder, empty, more in a pipe than the budget allows.
    """
    file, name = Path(path), str(path)
    status = _status(path)
    if stat.S_ISDIR(status.st_mode):
        yield Source(file, name, "", budget)
        return
    if stat.S_ISREG(status.st_mode) and not name.startswith(DESCRIPTORS):
        if status.st_size == 0:
            raise InputError(f"{name} is empty; record or export it again.")
        yield Source(file, name, file.suffix.lower(), budget)
        return
    suffix = file.suffix.lower() or PIPED
    with tempfile.TemporaryDirectory(prefix="missing-physics-") as folder:
        copy = Path(folder) / f"piped{suffix}"
        if not _copied(file, copy, most=budget.limit):
            raise InputError(f"{name} is empty; record or export it again.")
        yield Source(copy, name, suffix, budget)


def _status(path: str | os.PathLike[str]) -> os.stat_result:
    try:
        status = os.stat(path)
    except (FileNotFoundError, NotADirectoryError, ValueError):
        raise InputError(f"{path} does not exist; give the path of a recording.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror or error}).") from None
    if stat.S_ISDIR(status.st_mode) and not (Path(path) / BAG_FILE).is_file():
        raise InputError(f"{path} is a folder, not a recording; give the path of a recording.")
    return status


def _copied(pipe: Path, copy: Path, *, most: float) -> int:
    """Copy the content of a pipe until its end; returns the number of bytes."""
    try:
        incoming = pipe.open("rb")
    except OSError as error:
        raise InputError(f"{pipe} cannot be read ({error.strerror or error}).") from None
    count = 0
    with incoming, copy.open("wb") as file:
        while block := incoming.read(BLOCK):
            count += len(block)
            if count > most:
                raise InputError(
                    f"more than {most / 1e9:g} GB come through {pipe}; keep fewer samples or columns, or "
                    "allow more (--size-limit)."
                )
            file.write(block)
    return count
