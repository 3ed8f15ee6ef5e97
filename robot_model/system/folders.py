"""Several files as one unit: a folder holds all of an earlier set or all of the new one.

The new set is written into a fresh folder on the same disk. The next step depends on the folder for the
results. If it does not exist, the fresh one gets its name. If it holds only the earlier set, the two exchange
their names, in one system call. Otherwise, if it contains other files or is a working directory, the fresh
folder is moved into it under the name `.placing-...`, from which moment the new set is valid: the earlier
files are moved out one by one, then the new ones in, so that they are never mixed. If the process is killed
in between, the next one that writes or reads there completes this.
"""

from __future__ import annotations

import ctypes
import errno
import json
import os
import shutil
import stat
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from robot_model.input.errors import InputError
from robot_model.system.interrupts import undisturbed
from robot_model.system.owners import WRITING, fresh_name, held, is_left, remove_left

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["finish", "replacing_set"]

#: Prefix of the name of a new set while it is moved into a folder.
PLACING = ".placing-"
#: In it: the list of earlier files that are not replaced, and the earlier files themselves.
OBSOLETE, EARLIER = ".obsolete.json", ".earlier"
#: Arguments of `renameat2` (Linux 3.15): names are relative to the working directory; exchange them.
AT_FDCWD, RENAME_EXCHANGE = -100, 2


@contextmanager
def replacing_set(folder: str | os.PathLike[str], former: Collection[str] = ()) -> Iterator[Path]:
    """A fresh folder whose files replace those of an earlier set if the block succeeds.

    Whenever the process dies, `folder` holds the one set or the other. Other files in it stay.

    Args:
        folder: for the results; made if there is none.
        former: the earlier set, as paths in `folder`; those that the new one lacks are removed.

    Raises:
        InputError: the folder cannot be written to.
    """
    target = Path(os.path.realpath(folder))
    with _reported(target):
        finish(target)
        stage = _Stage(target)
    try:
        with held(stage.root):
            yield stage.content
            with _reported(target):
                stage.place(former)
    except InputError as error:  # of a file in the fresh folder
        raise InputError(str(error).replace(str(stage.content), str(target))) from error
    finally:
        shutil.rmtree(stage.root, ignore_errors=True)


def finish(folder: str | os.PathLike[str]) -> None:
    """Complete the work of a killed process in `folder`, and remove its remains there and next to it."""
    target = Path(os.path.realpath(folder))
    _, there = _missing(target) if not target.exists() else (target, target.parent)
    for place in (target, there):
        remove_left(place, WRITING)
    if not target.is_dir():
        return
    for placing in target.glob(f"{PLACING}*"):
        with _alone(target):
            if is_left(placing):
                for source, goal in _moves(placing, target):
                    _move(source, goal)
                _entered(placing, target)


class _Stage:
    """The fresh folder for a new set.

    Attributes:
        root: removed in the end.
        content: folder of the new set, in `root` or `root` itself.
    """

    def __init__(self, target: Path) -> None:
        if target.exists() and not target.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        self._target = target
        # Missing parent folders are created with the new set.
        self._first, there = (target, _beside(target)) if target.exists() else _missing(target)
        self.root = there / fresh_name()
        self.content = self.root / target.relative_to(self._first)
        self.content.mkdir(parents=True)

    def place(self, former: Collection[str]) -> None:
        """Replace the earlier set by the new one."""
        new = _files(self.content)
        _on_disk(self.root)
        with undisturbed():
            if not self._target.exists() and _renamed(self.root, self._first):
                _on_disk(self._first.parent, deep=False)
                return
            with _alone(self._target):
                self._check(new)
                if not _exchanged(self.content, self._target, {*former, *new}):
                    self._move_in(set(former) - new)

    def _check(self, new: Iterable[str]) -> None:
        for name in new:
            if _is_folder(self._target / name):
                raise InputError(f"cannot write {self._target / name}: it is a folder; remove or rename it.")

    def _move_in(self, obsolete: set[str]) -> None:
        (self.content / OBSOLETE).write_text(json.dumps(sorted(obsolete)))
        _on_disk(self.content / OBSOLETE)
        placing = self._target / fresh_name(PLACING)
        if not _renamed(self.content, placing):  # the folder is on another disk than what is beside it
            inside = self._target / fresh_name()
            try:
                shutil.copytree(self.content, inside)
                _on_disk(inside)
                inside.rename(placing)
            finally:
                shutil.rmtree(inside, ignore_errors=True)
        _on_disk(placing, deep=False)
        with held(placing):
            self._enter(placing)

    def _enter(self, placing: Path) -> None:
        """Move files until all are in place; if the system refuses one, all are moved back."""
        done: list[tuple[Path, Path]] = []
        try:
            for source, goal in _moves(placing, self._target):
                _move(source, goal)
                done.append((source, goal))
        except OSError:
            for source, goal in reversed(done):
                goal.rename(source)
            shutil.rmtree(placing, ignore_errors=True)
            raise
        _entered(placing, self._target)


def _missing(target: Path) -> tuple[Path, Path]:
    """The first missing folder on the path to `target`, and its parent."""
    while not target.parent.exists():
        target = target.parent
    return target, target.parent


def _beside(target: Path) -> Path:
    """Folder for writing a new set for `target`: next to it, or in it where that is not possible."""
    parent = target.parent
    possible = os.access(parent, os.W_OK | os.X_OK) and not os.path.ismount(target)
    return parent if possible and parent.stat().st_dev == target.stat().st_dev else target


def _renamed(source: Path, target: Path) -> bool:
    """Whether `source` could be renamed to `target`; not if that exists, or is on another disk."""
    try:
        source.rename(target)
    except OSError as error:
        if error.errno in (errno.EXDEV, errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
            return False
        raise
    return True


def _exchanged(content: Path, target: Path, names: Collection[str]) -> bool:
    """Whether both could exchange their names without side effects other than the content of `target`."""
    own, other = content.stat(), target.stat()
    alike = (own.st_uid, own.st_gid, own.st_dev) == (other.st_uid, other.st_gid, other.st_dev)
    if not alike or _has_attributes(target) or not _holds_only(target, names) or _is_entered(target):
        return False
    content.chmod(stat.S_IMODE(other.st_mode))
    if not _exchange(content, target):
        return False
    _on_disk(target.parent, deep=False)
    return True


def _exchange(one: Path, other: Path) -> bool:
    try:
        call = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):  # not this system
        return False
    return bool(call(AT_FDCWD, os.fsencode(one), AT_FDCWD, os.fsencode(other), RENAME_EXCHANGE) == 0)


def _has_attributes(folder: Path) -> bool:
    """Whether the folder has attributes besides its mode, such as an access control list."""
    try:
        return bool(os.listxattr(folder)) if hasattr(os, "listxattr") else True
    except OSError:
        return False  # a file system without attributes


def _holds_only(folder: Path, names: Collection[str]) -> bool:
    folders = {above.as_posix() for name in names for above in Path(name).parents}
    for path, below, files in os.walk(folder):
        inner = Path(path).relative_to(folder)
        if not {(inner / name).as_posix() for name in files} <= set(names):
            return False
        if not {(inner / name).as_posix() for name in below} <= folders:
            return False
    return True


def _is_entered(folder: Path) -> bool:
    """Whether it, or a folder in it, is the working directory of a process, which would move with it."""
    places = []
    with suppress(OSError):  # it was removed
        places.append(os.getcwd())
    for process in Path("/proc").glob("[0-9]*/cwd"):
        with suppress(OSError):  # the process has ended, or is another user's
            places.append(os.readlink(process))
    return any(folder == Path(place) or folder in Path(place).parents for place in places)


def _moves(placing: Path, target: Path) -> list[tuple[Path, Path]]:
    """Remaining moves of files, source to destination: the earlier ones out of `target` first."""
    obsolete: list[str] = []
    with suppress(FileNotFoundError):  # else all was done but the removal
        obsolete = json.loads((placing / OBSOLETE).read_text("utf-8"))
    new = sorted(_files(placing) - {OBSOLETE})
    leaving = [(target / name, placing / EARLIER / name) for name in (*obsolete, *new)]
    entering = [(placing / name, target / name) for name in new]
    return [(a, b) for a, b in leaving if os.path.lexists(a) and not _is_folder(a)] + entering


def _move(source: Path, goal: Path) -> None:
    goal.parent.mkdir(parents=True, exist_ok=True)
    source.rename(goal)


def _entered(placing: Path, target: Path) -> None:
    """All files are in place: remove the transfer folder, its list first."""
    _on_disk(target, deep=False)
    (placing / OBSOLETE).unlink(missing_ok=True)
    shutil.rmtree(placing, ignore_errors=True)


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _files(folder: Path) -> set[str]:
    """Paths in `folder` of all files of a new set."""
    found = (path.relative_to(folder) for path in folder.rglob("*") if not _is_folder(path))
    return {path.as_posix() for path in found if path.parts[0] != EARLIER}


def _on_disk(path: Path, *, deep: bool = True) -> None:
    """Wait until it is on disk, and with `deep` also its content."""
    if deep and _is_folder(path):
        for inner in path.iterdir():
            _on_disk(inner)
    if os.name == "posix" or not _is_folder(path):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextmanager
def _alone(target: Path) -> Iterator[None]:
    """Exclusive access for putting files into `target`."""
    if fcntl is None:
        yield
        return
    handle = -1
    while handle < 0 or os.fstat(handle).st_ino != target.stat().st_ino:  # else it was exchanged meanwhile
        if handle >= 0:
            os.close(handle)
        handle = os.open(target, os.O_RDONLY)
        with suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
    try:
        yield
    finally:
        os.close(handle)


@contextmanager
def _reported(target: Path) -> Iterator[None]:
    """Report errors of the system in one sentence."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot write into {target}: {error.strerror or error}.") from error
