"""Atomic writing of files."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robot_model.input.errors import InputError
from robot_model.input.memory import lacks_memory
from robot_model.system.owners import WRITING, fresh_name, held, remove_left

__all__ = ["lacks_room", "replacing", "require_folder", "write_atomically"]

#: Errors of a full or faulty machine, not of the input.
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE)


def lacks_room(error: BaseException) -> bool:
    """Whether disk or memory was full, by the machine's error or by an `InputError` that it caused."""
    cause: BaseException | None = error
    while isinstance(cause, InputError):
        cause = cause.__context__
    if cause is None:
        return False
    return lacks_memory(cause) or (isinstance(cause, OSError) and cause.errno in FULL)


def require_folder(path: str | os.PathLike[str]) -> None:
    """Raises `InputError` if no file can be written to a folder, before work whose results would be lost.

    The folder need not exist yet.
    """
    target = Path(path)
    try:
        there = next(place for place in (target, *target.absolute().parents) if place.exists())
        if not there.is_dir():
            raise InputError(f"{there} is a file; give a folder for the results.")
        if not os.access(there, os.W_OK | os.X_OK):
            raise InputError(f"{there} cannot be written to; give another folder for the results.")
    except OSError as error:
        raise InputError(f"cannot write into {target}: {error.strerror or error}.") from None


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path next to `path` that replaces it when the block ends without an error.

    For libraries that write files themselves. The temporary file keeps the suffix of `path` and is removed
    when the block fails. Raises `InputError` when the folder cannot be written.
    """
    target = Path(path)
    temporary = target.parent / fresh_name(suffix=target.suffix)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        remove_left(target.parent, WRITING)
        # Permissions according to the user's umask.
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror or error}.") from None
    try:
        with held(temporary):
            yield temporary
        _put_in_place(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def _put_in_place(temporary: Path, target: Path) -> None:
    try:
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        temporary.replace(target)
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror or error}.") from None


def write_atomically(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write `content` (text as UTF-8) to `path` atomically; a reader sees the old file or the new one."""
    with replacing(path) as temporary:
        try:
            temporary.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror or error}.") from None
