"""Reading files of robots, with a bound on their size and messages for system errors."""

from __future__ import annotations

import os
from pathlib import Path

from robot_model.input.errors import InputError
from robot_model.input.toml import LARGEST_FILE

__all__ = ["MARKUP", "bytes_of", "is_markup", "stem_of"]

#: Suffixes of robot files in XML.
MARKUP = (".urdf", ".xacro", ".mjcf", ".xml")


def is_markup(path: Path) -> bool:
    """Whether a file is XML, by its suffix or its first bytes."""
    if path.suffix.lower() in MARKUP:
        return True
    if path.suffix.lower() == ".toml":
        return False
    try:
        with path.open("rb") as file:
            return file.read(64).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")
    except OSError:
        return False


def stem_of(path: Path) -> str:
    """``arm`` of ``arm.urdf.xacro``: the name without the suffixes of robot files."""
    name = path.name
    while (suffix := Path(name).suffix) and suffix.lower() in MARKUP:
        name = name.removesuffix(suffix)
    return name


def bytes_of(path: Path) -> bytes:
    """The content of a file. Raises `InputError`."""
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            content = file.read(LARGEST_FILE + 1) if size <= LARGEST_FILE else b""
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None
    if max(size, len(content)) > LARGEST_FILE:
        raise InputError(
            f"{path} has {max(size, len(content)) / 2**20:.0f} MiB, which is no robot file; one may have "
            f"{LARGEST_FILE / 2**20:.0f} MiB."
        )
    return content
