"""Several files are replaced as a unit: however the program ends, a folder holds the old set or the new."""

from __future__ import annotations

import os
import resource
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from robot_model import InputError, lacks_room, replacing_set, write_atomically
from robot_model.system import folders
from robot_model.system.folders import finish

OLD = {"a": "old", "b": "old", "c": "old", "below/e": "old"}
NEW = {"a": "new", "b": "new", "d": "new", "below/e": "new"}
#: Audited calls that change the names on the disk, and what comes right before the exchange of two.
CHANGES = {"os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.chmod", "ctypes.dlsym"}


@pytest.fixture(autouse=True)
def _no_power_cuts(monkeypatch: pytest.MonkeyPatch) -> None:
    """What only a power cut would lose need not be waited for: it takes most of the time."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)


def write(files: dict[str, str], folder: Path) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def placed(files: dict[str, str], folder: Path) -> None:
    with replacing_set(folder, list(OLD)) as fresh:
        write(files, fresh)


def held_by(folder: Path) -> dict[str, str]:
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_text() for path in paths}


def seen(folder: Path) -> dict[str, str]:
    """What somebody finds who lists the folder, hidden names apart."""
    return {name: text for name, text in held_by(folder).items() if not name.startswith(".")}


def in_a_process(work: Callable[[], None]) -> int:
    """How a process that does this work ends: its exit code, or a signal's number below zero."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            work()
            code = 0
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def killed_at(count: int, work: Callable[[], None]) -> Callable[[], None]:
    """The same work in a process that is killed before so many changes of the disk."""
    left = [count]

    def hook(event: str, arguments: object) -> None:
        if event in CHANGES:
            if left[0] == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            left[0] -= 1

    def killed() -> None:
        sys.addaudithook(hook)
        work()

    return killed


def folder_with(tmp_path: Path, *, alone: bool) -> Path:
    folder = tmp_path / "out"
    placed(OLD, folder)
    if not alone:
        (folder / "mine.csv").write_text("of the user")
        (folder / "below" / "mine.csv").write_text("of the user")
    return folder


@pytest.mark.parametrize("alone", [True, False])
def test_a_killed_process_leaves_one_complete_set(tmp_path: Path, alone: bool) -> None:
    """Killed before every change of the disk in turn; beside other files the next run does the rest."""
    mine = {} if alone else {"mine.csv": "of the user", "below/mine.csv": "of the user"}
    outcomes, count, code = [], 0, -signal.SIGKILL
    while code == -signal.SIGKILL:
        folder = folder_with(tmp_path / str(count), alone=alone)
        code = in_a_process(killed_at(count, lambda folder=folder: placed(NEW, folder)))  # type: ignore[misc]
        found = {name: text for name, text in seen(folder).items() if name not in mine}
        assert len(set(found.values())) < 2  # never mixed
        if alone:
            assert found in (OLD, NEW)
        finish(folder)
        assert held_by(folder) in ({**OLD, **mine}, {**NEW, **mine})
        outcomes.append(folder.joinpath("a").read_text())
        assert [path.name for path in folder.parent.iterdir()] == ["out"]
        count += 1
    assert code == 0
    assert outcomes == sorted(outcomes, reverse=True)  # the old one, and from some change on the new one
    assert outcomes.count("old") > 3
    assert outcomes.count("new") > (1 if alone else 8)


def test_a_killed_process_creates_a_complete_folder_or_none(tmp_path: Path) -> None:
    count, code = 0, -signal.SIGKILL
    while code == -signal.SIGKILL:
        folder = tmp_path / str(count) / "deep" / "out"
        folder.parents[1].mkdir()
        code = in_a_process(killed_at(count, lambda folder=folder: placed(NEW, folder)))  # type: ignore[misc]
        assert held_by(folder) == NEW if folder.exists() else not folder.parent.exists()
        finish(folder)
        assert [path.name for path in folder.parents[1].iterdir() if path.name.startswith(".")] == []
        count += 1
    assert code == 0
    assert count > 5


@pytest.mark.parametrize("alone", [True, False])
def test_the_next_set_removes_remains_of_a_killed_process(tmp_path: Path, alone: bool) -> None:
    folder = folder_with(tmp_path, alone=alone)

    def dying() -> None:
        with replacing_set(folder) as fresh:
            write({"a": "half"}, fresh)
            os.kill(os.getpid(), signal.SIGKILL)

    assert in_a_process(dying) == -signal.SIGKILL
    assert len(list(tmp_path.iterdir())) == 2
    placed(NEW, folder)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_failure_leaves_the_old_set_and_nothing_else(tmp_path: Path) -> None:
    folder = folder_with(tmp_path, alone=False)
    before = held_by(folder)

    def failing() -> None:
        with replacing_set(folder, list(OLD)) as fresh:
            write({"a": "half"}, fresh)
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        failing()
    assert held_by(folder) == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_failure_makes_no_folder(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), replacing_set(tmp_path / "deep" / "out"):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_may_not_grow_leaves_the_old_set(tmp_path: Path) -> None:
    """As a full disk does, in a process of its own: the limit holds for all its files."""
    folder = folder_with(tmp_path, alone=True)

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
        with pytest.raises(InputError, match=r"^cannot write .*/out/b: File too large\.$") as found:
            large()
        assert lacks_room(found.value)

    def large() -> None:
        with replacing_set(folder, list(OLD)) as fresh:
            write_atomically(fresh / "a", "new")
            write_atomically(fresh / "b", "x" * 2000)

    assert in_a_process(limited) == 0
    assert held_by(folder) == OLD
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("refused", [3, 6])
def test_a_refusal_half_way_restores_the_old_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: int
) -> None:
    folder = folder_with(tmp_path, alone=False)
    before = held_by(folder)
    real, calls = folders._move, []

    def failing(source: Path, goal: Path) -> None:
        calls.append(source)
        if len(calls) == refused:
            raise OSError(5, "Input/output error")
        real(source, goal)

    monkeypatch.setattr(folders, "_move", failing)
    with pytest.raises(InputError, match=r"^cannot write into .*: Input/output error\.$"):
        placed(NEW, folder)
    assert held_by(folder) == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_interrupt_is_deferred_until_the_set_is_in_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = folder_with(tmp_path, alone=False)
    real = folders._move

    def interrupted(source: Path, goal: Path) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        real(source, goal)

    monkeypatch.setattr(folders, "_move", interrupted)
    with pytest.raises(KeyboardInterrupt):
        placed(NEW, folder)
    assert {name: text for name, text in held_by(folder).items() if "mine" not in name} == NEW


def test_the_working_folder_stays_the_same_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A shell in it would otherwise be in a folder that is removed."""
    folder = folder_with(tmp_path, alone=True)
    monkeypatch.chdir(folder)
    before = folder.stat().st_ino
    placed(NEW, Path("."))
    assert folder.stat().st_ino == before
    assert held_by(Path(".")) == NEW
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_link_to_a_folder_stays_a_link(tmp_path: Path) -> None:
    folder = folder_with(tmp_path / "elsewhere", alone=True)
    (tmp_path / "link").symlink_to(folder)
    placed(NEW, tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert held_by(folder) == NEW


@pytest.mark.parametrize("alone", [True, False])
def test_a_mount_point_is_written_from_inside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, alone: bool
) -> None:
    folder = folder_with(tmp_path, alone=alone)
    before = folder.stat().st_ino
    monkeypatch.setattr(os.path, "ismount", lambda path: Path(path) == folder)
    with replacing_set(folder, list(OLD)) as fresh:
        assert fresh.parent == folder
        write(NEW, fresh)
    assert folder.stat().st_ino == before
    assert {name: text for name, text in held_by(folder).items() if "mine" not in name} == NEW


def test_a_set_on_another_disk_is_copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As with a bind mount, which looks like the disk around it."""
    folder = folder_with(tmp_path, alone=False)
    real = Path.rename

    def rename(path: Path, target: Path) -> Path:
        if path.parent == tmp_path and Path(target).parent == folder:
            raise OSError(18, "Invalid cross-device link")
        return real(path, target)

    monkeypatch.setattr(Path, "rename", rename)
    placed(NEW, folder)
    assert {name: text for name, text in held_by(folder).items() if "mine" not in name} == NEW
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(("umask", "file", "folder"), [(0o077, 0o600, 0o700), (0o002, 0o664, 0o775)])
def test_the_umask_is_respected(tmp_path: Path, umask: int, file: int, folder: int) -> None:
    before = os.umask(umask)
    try:
        placed(NEW, tmp_path / "out")
    finally:
        os.umask(before)
    assert (tmp_path / "out").stat().st_mode & 0o777 == folder
    assert (tmp_path / "out" / "a").stat().st_mode & 0o777 == file


def test_a_folder_keeps_its_mode(tmp_path: Path) -> None:
    folder = folder_with(tmp_path, alone=True)
    folder.chmod(0o750)
    placed(NEW, folder)
    assert folder.stat().st_mode & 0o777 == 0o750
    assert held_by(folder) == NEW


def test_a_folder_in_the_place_of_a_file_is_unusable_input(tmp_path: Path) -> None:
    folder = folder_with(tmp_path, alone=True)
    (folder / "d").mkdir()
    with pytest.raises(InputError, match=r"^cannot write .*out/d: it is a folder; remove or rename it\.$"):
        placed(NEW, folder)
    assert held_by(folder) == OLD


def test_a_file_in_the_place_of_the_folder_is_unusable_input(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("x")
    with pytest.raises(InputError, match=r"^cannot write into .*out: Not a directory\.$"):
        placed(NEW, tmp_path / "out")
    assert held_by(tmp_path) == {"out": "x"}
