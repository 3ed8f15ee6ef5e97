"""Reading output of an untrusted process: regular files only, no links, limited size."""

from __future__ import annotations

import os
import stat
from collections.abc import Sequence
from pathlib import Path

__all__ = ["LARGEST", "untrusted_files"]

#: Largest size of one file [bytes]: a long recording's viewer file has some tens of millions.
LARGEST = 1 << 28
_FILE = (
    os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)
)
_FOLDER = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_DIRECTORY", 0)


def untrusted_files(
    folder: Path, within: str, names: Sequence[str], *, largest: int = LARGEST
) -> dict[str, bytes]:
    """Contents of those files of `folder/within` that are plain files with a single name.

    Symbolic and hard links, pipes, devices, folders, files of more than `largest` bytes and missing files are
    omitted; `within` may not be a link either.

    Args:
        folder: our own, so that its path is trusted.
        within: a folder in it that the other process could write to.
        names: of files directly in that folder.
        largest: bytes.
    """
    if os.open not in os.supports_dir_fd:  # Windows
        place = folder / within
        plain = [] if place.is_symlink() else [n for n in names if not (place / n).is_symlink()]
        return {n: (place / n).read_bytes() for n in plain if (place / n).is_file()}
    found: dict[str, bytes] = {}
    ours = os.open(folder, _FOLDER)
    try:
        theirs = os.open(within, _FOLDER, dir_fd=ours)
    except OSError:
        return found
    finally:
        os.close(ours)
    try:
        for name in names:
            content = _plain(name, theirs, largest)
            if content is not None:
                found[name] = content
    finally:
        os.close(theirs)
    return found


def _plain(name: str, folder: int, largest: int) -> bytes | None:
    try:
        handle = os.open(name, _FILE, dir_fd=folder)
    except OSError:
        return None
    state = os.fstat(handle)
    if not stat.S_ISREG(state.st_mode) or state.st_nlink != 1 or state.st_size > largest:
        os.close(handle)
        return None
    with os.fdopen(handle, "rb") as file:
        content = file.read(largest + 1)
    return content if len(content) <= largest else None
