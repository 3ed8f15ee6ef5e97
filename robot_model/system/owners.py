"""Temporary files and folders with their owner in the name, so that those of dead processes can be removed.

A name holds the id of the process that made it and its start time, since ids are reused:
`.writing-4711-839201-f3a9c2d1`. Its owner also holds a lock on it, which shows that a process in another
container, whose id is meaningless here, is alive.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # not on Windows, where nothing is removed either
    fcntl = None  # type: ignore[assignment]

__all__ = ["WRITING", "fresh_name", "held", "is_left", "own_prefix", "remove_left"]

#: Prefix of the names of results while they are written.
WRITING = ".writing-"
_OWNER = re.compile(r"(?P<process>\d+)-(?P<began>\d+)-\w+(\.\w+)?")
#: Position of the start time and of the state among the words of /proc/PID/stat that follow the name.
_BEGAN, _STATE = 19, 0


def own_prefix(prefix: str) -> str:
    """Beginning of a name owned by this process, after `prefix`; a random part has to follow."""
    return f"{prefix}{os.getpid()}-{_began(os.getpid()) or 0}-"


def fresh_name(prefix: str = WRITING, suffix: str = "") -> str:
    """A unique name owned by this process."""
    return f"{own_prefix(prefix)}{secrets.token_hex(4)}{suffix}"


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Lock `path`, a file or folder of this process, as in use."""
    handle = _opened(path)
    try:
        if handle is not None and fcntl is not None:
            with suppress(OSError):  # a file system without locks
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        if handle is not None:
            os.close(handle)


def remove_left(folder: Path, *prefixes: str) -> None:
    """Remove remains of dead processes of this user in `folder` under names of these prefixes."""
    with suppress(OSError):
        for path in [Path(entry) for entry in os.scandir(folder) if entry.name.startswith(prefixes)]:
            if is_left(path):
                _remove(path)


def is_left(path: Path) -> bool:
    """Whether a dead process of this user made `path`; False if that cannot be determined."""
    prefix, _, rest = path.name.partition("-")
    owner = _OWNER.fullmatch(rest)
    if not prefix or owner is None or os.name != "posix":
        return False
    try:
        mine = path.lstat().st_uid == os.geteuid()
    except OSError:
        return False
    return mine and not _lives(int(owner["process"]), owner["began"]) and not _is_held(path)


def _lives(process: int, began: str) -> bool:
    if _began(os.getpid()) is not None:
        return _began(process) == began
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        pass
    return True


def _began(process: int) -> str | None:
    """Start time of a process, in clock ticks since boot; None for a dead one, or without /proc."""
    try:
        words = Path(f"/proc/{process}/stat").read_text("utf-8", "replace").rpartition(")")[2].split()
    except OSError:
        return None
    return None if words[_STATE] in "ZX" else words[_BEGAN]


def _is_held(path: Path) -> bool:
    """Whether another process holds its lock on `path`."""
    handle = _opened(path)
    if handle is None or fcntl is None:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks: the owner could not lock it either
        return False
    finally:
        os.close(handle)
    return False


def _opened(path: Path) -> int | None:
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    try:
        return os.open(path, flags)
    except OSError:
        return None


def _remove(path: Path) -> None:
    with suppress(OSError):
        if stat.S_ISDIR(path.lstat().st_mode):
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()
