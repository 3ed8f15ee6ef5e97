"""Untrusted TOML, read and parsed in bounded time and memory."""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path
from typing import Any

from robot_model.input.errors import InputError

__all__ = ["LARGEST_FILE", "toml_tables", "toml_text"]

#: A robot with a million-row reference table stays below this [bytes].
LARGEST_FILE = 16 * 2**20
#: Parts of a dotted key. No description nests a third as deep, while the parser's time and memory grow with
#: the square of the number of parts (100,000 of them: a minute and 2.4 GB).
MOST_PARTS = 32
#: Digits of a whole number that Python converts (`sys.set_int_max_str_digits`).
MOST_DIGITS = 4300

_PART = r"""(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"?+|'[^'\n]*+'?+)"""
_DOT = r"[ \t]*+\.[ \t]*+"
#: Comments and strings of several lines, a key of too many parts, anything else. Every alternative succeeds
#: where it begins and gives nothing back, so that the time grows with the length of the text.
_TOKEN = re.compile(
    r'#[^\n]*+|"""(?:[^"\\]|\\.|"(?!""))*+(?:""")?+|' + r"'{3}(?:[^']|'(?!''))*+(?:'{3})?+|"
    rf"(?P<long>{_PART}(?:{_DOT}{_PART}){{{MOST_PARTS},}}+)|{_PART}(?:{_DOT}{_PART})*+|[^#\"'A-Za-z0-9_-]++",
    re.DOTALL,
)
_LONG_NUMBER = re.compile(rf"(?<![0-9_])[0-9_]{{{MOST_DIGITS + 1}}}")


def toml_text(path: Path, what: str) -> str:
    """The text of a TOML file, which may be a pipe; a byte order mark is removed.

    Args:
        path: the file.
        what: what it should be, for messages: "robot", "mapping", "overlay".

    Raises:
        InputError: too large, not UTF-8, cannot be read.
    """
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            content = file.read(LARGEST_FILE + 1) if size <= LARGEST_FILE else b""
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None
    if max(size, len(content)) > LARGEST_FILE:  # a pipe has no size
        raise InputError(
            f"{path} has {max(size, len(content)) / 2**20:.0f} MiB, which is no {what} file; one may have "
            f"{LARGEST_FILE / 2**20:.0f} MiB."
        )
    try:
        text = content.decode("utf-8-sig")  # some editors begin a file with a byte order mark
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not a text file: byte {error.start} is not UTF-8; save it as UTF-8."
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def toml_tables(text: str, *, source: str, what: str) -> dict[str, Any]:
    """The tables of TOML text.

    Args:
        text: TOML.
        source: the file, for messages.
        what: what it should be, for messages: "robot", "mapping", "overlay".

    Raises:
        InputError: not TOML, nested too deeply, a number of thousands of digits.
    """
    no = f"{source} is not {'an' if what[0] in 'aeiou' else 'a'} {what}"
    if long := next((token for token in _TOKEN.finditer(text) if token["long"]), None):
        raise InputError(
            f"{no}: line {_line(text, long)} has a key of more than {MOST_PARTS} dotted parts; "
            "give the tables that are meant."
        )
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{no}: its lists or tables are nested too deeply.") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source} is not valid TOML: {error}.") from None
    except ValueError:  # Python refuses to convert a number
        long = _LONG_NUMBER.search(text)
        place = f"line {_line(text, long)}" if long else "it"
        raise InputError(f"{no}: {place} holds a number of thousands of digits.") from None


def _line(text: str, found: re.Match[str]) -> int:
    return text.count("\n", 0, found.start()) + 1
