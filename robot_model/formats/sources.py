"""Reading whole files of robots, with a bound on their size and sentences for what the system says."""

from __future__ import annotations

from pathlib import Path

from robot_model.errors import InputError
from robot_model.input.toml import LARGEST_FILE

__all__ = ["MARKUP", "bytes_of", "is_markup"]

#: Suffixes of robot files in XML.
MARKUP = (".urdf", ".xacro", ".mjcf", ".xml")


def is_markup(path: Path) -> bool:
    """Whether a file is XML, by its suffix or by how it begins."""
    if path.suffix.lower() in MARKUP:
        return True
    if path.suffix.lower() == ".toml":
        return False
    try:
        with path.open("rb") as file:
            return file.read(64).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")
    except OSError:
        return False


def bytes_of(path: Path) -> bytes:
    """The content of a file. Raises `InputError`."""
    try:
        _check_size(path)
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None


def _check_size(path: Path) -> None:
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise InputError(
            f"{path} has {size / 2**20:.0f} MiB, which is no robot file; one may have "
            f"{LARGEST_FILE / 2**20:.0f} MiB."
        )
