"""Files that another process may have tampered with are read only if they are plain files."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robot_model.system.untrusted import untrusted_files

NAMES = ("answer.json", "robot.toml")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "robot.toml").write_bytes(b"robot")
    (tmp_path / "secret").write_bytes(b"key")
    return tmp_path


def test_only_plain_files_are_read(folder: Path) -> None:
    (folder / "out" / "other.txt").write_bytes(b"not asked for")
    assert untrusted_files(folder, "out", NAMES) == {"robot.toml": b"robot"}


@pytest.mark.parametrize("kind", ["symbolic", "hard", "pipe", "folder", "large"])
def test_other_files_than_plain_ones_are_omitted(folder: Path, kind: str) -> None:
    place = folder / "out" / "answer.json"
    if kind == "symbolic":
        place.symlink_to(folder / "secret")
    elif kind == "hard":
        os.link(folder / "secret", place)
    elif kind == "pipe":
        os.mkfifo(place)  # nobody writes to it: a plain open would wait for ever
    elif kind == "folder":
        place.mkdir()
    else:
        place.write_bytes(b"x" * 101)
    assert untrusted_files(folder, "out", NAMES, largest=100) == {"robot.toml": b"robot"}


def test_a_folder_that_is_a_link_is_not_followed(folder: Path) -> None:
    (folder / "elsewhere").mkdir()
    (folder / "elsewhere" / "answer.json").write_bytes(b"key")
    (folder / "there").symlink_to(folder / "elsewhere")
    assert untrusted_files(folder, "there", NAMES) == {}
    assert untrusted_files(folder, "missing", NAMES) == {}
