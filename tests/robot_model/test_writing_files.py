"""A file is written completely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robot_model import InputError, replacing, require_folder, write_atomically


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_text_and_bytes(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a.txt", "grün\r\n")
    write_atomically(tmp_path / "b.bin", b"\x00\xff")
    assert (tmp_path / "a.txt").read_bytes() == "grün\r\n".encode()
    assert (tmp_path / "b.bin").read_bytes() == b"\x00\xff"
    assert names(tmp_path) == ["a.txt", "b.bin"]


def test_folders_are_made(tmp_path: Path) -> None:
    write_atomically(tmp_path / "new" / "deep" / "a.txt", "x")
    assert (tmp_path / "new" / "deep" / "a.txt").read_text() == "x"


def fail_half_way(target: Path) -> None:
    with replacing(target) as temporary:
        temporary.write_text("half")
        raise RuntimeError("half way")


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(RuntimeError, match="half way"):
        fail_half_way(target)
    assert target.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


def test_the_temporary_file_has_the_suffix_and_the_folder_of_the_target(tmp_path: Path) -> None:
    with replacing(tmp_path / "a.html") as temporary:
        assert temporary.suffix == ".html"
        assert temporary.parent == tmp_path
        temporary.write_text("x")
    assert names(tmp_path) == ["a.html"]


def test_a_file_in_the_place_of_a_folder_is_unusable_input(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"^cannot write .*file/a\.txt: .*\.$"):
        write_atomically(tmp_path / "file" / "a.txt", "x")
    assert names(tmp_path) == ["file"]


def test_a_folder_for_results_is_checked_beforehand(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    require_folder(tmp_path)
    require_folder(tmp_path / "not" / "yet")
    require_folder("")
    for wrong in ("file", "file/below"):
        with pytest.raises(InputError, match=r"file is a file; give a folder for the results\.$"):
            require_folder(tmp_path / wrong)
    assert names(tmp_path) == ["file"]


def test_a_folder_in_the_place_of_the_file_is_unusable_input(tmp_path: Path) -> None:
    (tmp_path / "a.txt").mkdir()
    with pytest.raises(InputError, match=r"^cannot write .*a\.txt: .*\.$"):
        write_atomically(tmp_path / "a.txt", "x")
    assert names(tmp_path) == ["a.txt"]


def test_a_file_has_the_permissions_of_the_umask(tmp_path: Path) -> None:
    for umask in (0o077, 0o002):
        before = os.umask(umask)
        try:
            write_atomically(tmp_path / "a.txt", "x")
        finally:
            os.umask(before)
        assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o666 & ~umask
