"""Reading whole files of robots, with a bound on their size and sentences for what the system says."""

from __future__ import annotations

from pathlib import Path

from robot_model.errors import InputError

__all__ = ["MARKUP", "bytes_of", "is_markup", "text_of"]

#: A robot with a million-row reference table stays below this [bytes].
LARGEST_FILE = 16 * 2**20

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


def text_of(path: Path) -> str:
    """The text of a file in UTF-8. Raises `InputError`."""
    try:
        _check_size(path)
        return path.read_text("utf-8-sig")  # some editors begin a file with a byte order mark
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not a text file: byte {error.start} is not UTF-8; save it as UTF-8."
        ) from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None


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
