"""Leftover files of dead processes are removed, those of running ones kept."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from robot_model import write_atomically
from robot_model.system.owners import WRITING, fresh_name, held, own_prefix, remove_left

#: Program that starts to write in the given folder, prints so, and waits for input or a kill.
BEGUN = """
import sys
from pathlib import Path
from robot_model.system.owners import fresh_name, held
for path in (Path(sys.argv[1]) / fresh_name(suffix=".html"), Path(sys.argv[1]) / fresh_name()):
    path.mkdir() if not path.suffix else path.touch()
(path / "inner").mkdir()
(path / "inner" / "file").touch()
with held(path):
    print("begun", flush=True)
    sys.stdin.read()
"""


def begun_in(folder: Path) -> subprocess.Popen[str]:
    words = [sys.executable, "-c", BEGUN, str(folder)]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    return process


def test_files_of_a_killed_process_are_removed(tmp_path: Path) -> None:
    process = begun_in(tmp_path)
    begun = set(tmp_path.iterdir())
    assert len(begun) == 2
    (tmp_path / "mine").touch()
    (tmp_path / ".writing-something else").touch()
    remove_left(tmp_path, WRITING)
    assert begun < set(tmp_path.iterdir())  # it lives
    os.kill(process.pid, signal.SIGKILL)
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # dead, though still in the list of processes
    remove_left(tmp_path, WRITING)
    assert {path.name for path in tmp_path.iterdir()} == {"mine", ".writing-something else"}
    process.communicate()


def test_the_next_file_removes_remains(tmp_path: Path) -> None:
    process = begun_in(tmp_path)
    process.kill()
    process.communicate()
    write_atomically(tmp_path / "a.txt", "x")
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_another_process_with_the_same_id_is_not_the_owner(tmp_path: Path) -> None:
    mine, other = tmp_path / f"{own_prefix(WRITING)}abcd", tmp_path / f"{WRITING}{os.getpid()}-1-abcd"
    for path in (mine, other):
        path.touch()
    remove_left(tmp_path, WRITING)
    assert list(tmp_path.iterdir()) == [mine]


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_a_process_of_another_container_is_known_by_its_lock(tmp_path: Path, kind: str) -> None:
    """Its number means nothing here."""
    path = tmp_path / f"{WRITING}{os.getpid()}-1-abcd"
    path.touch() if kind == "file" else path.mkdir()
    with held(path):
        remove_left(tmp_path, WRITING)
        assert path.exists()
    remove_left(tmp_path, WRITING)
    assert not path.exists()


def test_the_target_of_a_link_is_not_removed(tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.mkdir()
    (target / "file").touch()
    link = tmp_path / f"{WRITING}{os.getpid()}-1-abcd"
    link.symlink_to(target)
    remove_left(tmp_path, WRITING)
    assert not link.is_symlink()
    assert (target / "file").exists()


def test_names_are_unique(tmp_path: Path) -> None:
    assert fresh_name() != fresh_name()
    remove_left(tmp_path / "not there", WRITING)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_a_folder_in_which_a_killed_process_compiled_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from reference_model.codegen.compiled import c_library

    monkeypatch.setenv("MISSING_PHYSICS_COMPILED", "on")
    monkeypatch.setenv("MISSING_PHYSICS_CODE_CACHE", str(tmp_path))
    tmp_path.chmod(0o700)
    (tmp_path / f"{WRITING}{os.getpid()}-1-abcd").mkdir()
    c_library("int one(void) { return 1; }")
    assert [path.suffix for path in tmp_path.iterdir()] == [".so"]
