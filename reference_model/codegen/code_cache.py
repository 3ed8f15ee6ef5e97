"""Cache of compiled code between runs: a private folder of checksummed files.

An entry is one file whose name ends with the checksum of its content, so damaged files are detected and two
processes that make the same entry at once do not conflict: the last rename wins, and both wrote the same
content. Code is only loaded from a folder that only its owner can write to.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import sys
from pathlib import Path

__all__ = ["FOLDER_VARIABLE", "entry", "private_folder", "store"]

#: Environment variable that names another folder.
FOLDER_VARIABLE = "MISSING_PHYSICS_CODE_CACHE"

#: Hexadecimal digits of the checksum in a name: 128 bits.
DIGITS = 32
SUFFIX = ".so"


def private_folder() -> Path:
    """The folder of the cache, made when it is missing.

    Raises:
        PermissionError: others can write to it or to a folder above it.
    """
    named = os.environ.get(FOLDER_VARIABLE)
    folder = Path(named).expanduser() if named else _caches() / "missing-physics" / "code"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder = folder.resolve()
    _check_own(folder)
    for above in folder.parents:
        mode = above.stat().st_mode
        if mode & (stat.S_IWGRP | stat.S_IWOTH) and not mode & stat.S_ISVTX:
            raise PermissionError(f"others can replace what is below '{above}'")
    return folder


def _caches() -> Path:
    """The system's cache folder of the user."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def entry(folder: Path, key: str) -> Path | None:
    """The intact file stored under `key`; damaged ones are removed."""
    for path in sorted(folder.glob(f"{key}-*{SUFFIX}")):
        _check_own(path)
        if path.name == _name(key, path.read_bytes()):
            return path
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
    return None


def store(folder: Path, key: str, made: Path) -> Path:
    """Move a finished file, in the same file system, into the cache."""
    made.chmod(0o600)
    kept = folder / _name(key, made.read_bytes())
    os.replace(made, kept)
    return kept


def _name(key: str, content: bytes) -> str:
    return f"{key}-{hashlib.sha256(content).hexdigest()[:DIGITS]}{SUFFIX}"


def _check_own(path: Path) -> None:
    """Refuse files that another user owns or can write; on Windows a user's cache folder is private."""
    if not hasattr(os, "getuid"):
        return
    found = path.stat()
    if found.st_uid != os.getuid() or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(f"'{path}' is not this user's alone")
