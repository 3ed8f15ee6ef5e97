"""Datasets: the folder first, checksums always, nothing left behind by a bad download. No network."""

from __future__ import annotations

import hashlib
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from missing_physics.recordings import datasets
from missing_physics.recordings.datasets import DATASETS, DataFile, Dataset, fetch_dataset, local_folder
from robot_model import InputError

CONTENT = {"one.mat": b"first", "two words.mat": b"second"}
TINY = Dataset(
    name="tiny",
    what="two little files",
    repository="some/where",
    commit="0" * 40,
    licence="MIT",
    files=tuple(DataFile(n, f"data/{n}", hashlib.sha256(c).hexdigest()) for n, c in CONTENT.items()),
)


@pytest.fixture(autouse=True)
def _tiny(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(datasets, "DATASETS", {**DATASETS, "tiny": TINY})
    monkeypatch.setenv("MISSING_PHYSICS_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("MISSING_PHYSICS_DATA", raising=False)


class Downloader:
    """Stands in for the network: keeps the addresses it was asked for."""

    def __init__(self, *, damage: bytes = b"", fail: OSError | None = None) -> None:
        self.urls: list[str] = []
        self.damage, self.fail = damage, fail

    def __call__(self, url: str, output_file: Any, pooch: Any) -> None:
        self.urls.append(url)
        if self.fail:
            raise self.fail
        name = next(n for n in CONTENT if url.endswith(n.replace(" ", "%20")))
        Path(output_file).write_bytes(CONTENT[name] + self.damage)


def test_download_by_commit_into_the_cache_once(tmp_path: Path) -> None:
    downloader = Downloader()
    folder = fetch_dataset("tiny", downloader=downloader)
    assert folder == tmp_path / "cache" / "tiny"
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == CONTENT
    assert downloader.urls[1].endswith(f"/some/where/{'0' * 40}/data/two%20words.mat")
    fetch_dataset("tiny", downloader=downloader)
    assert len(downloader.urls) == 2


def test_wrong_checksum_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="SHA-256 differs"):
        fetch_dataset("tiny", downloader=Downloader(damage=b"!"))
    assert not [p for p in (tmp_path / "cache").rglob("*") if p.is_file()]


def test_a_damaged_file_in_the_cache_is_fetched_again(tmp_path: Path) -> None:
    folder = fetch_dataset("tiny", downloader=Downloader())
    (folder / "one.mat").write_bytes(b"rotten")
    fetch_dataset("tiny", downloader=Downloader())
    assert (folder / "one.mat").read_bytes() == CONTENT["one.mat"]


def test_no_network() -> None:
    downloader = Downloader(fail=OSError("no route to host"))
    with pytest.raises(
        InputError, match=r"cannot be downloaded \(no route to host\).*MISSING_PHYSICS_DATA=FOLDER"
    ):
        fetch_dataset("tiny", downloader=downloader)


def test_named_folder_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "mine" / "tiny"
    folder.mkdir(parents=True)
    monkeypatch.setenv("MISSING_PHYSICS_DATA", str(tmp_path / "mine"))
    (folder / "one.mat").write_bytes(CONTENT["one.mat"])
    assert local_folder("tiny") is None
    (folder / "two words.mat").write_bytes(CONTENT["two words.mat"])
    downloader = Downloader()
    assert fetch_dataset("tiny", downloader=downloader) == folder
    assert downloader.urls == []
    (folder / "one.mat").write_bytes(b"other")
    with pytest.raises(InputError, match=r"one\.mat is not the published file"):
        fetch_dataset("tiny", downloader=downloader)


def test_unknown_name() -> None:
    with pytest.raises(InputError, match="did you mean 'kuka_kr300'"):
        fetch_dataset("kuka_kr30")


@pytest.mark.parametrize("dataset", DATASETS.values(), ids=lambda d: d.name)
def test_registry_is_pinned(dataset: Dataset) -> None:
    assert re.fullmatch(r"[0-9a-f]{40}", dataset.commit)
    assert len({f.name for f in dataset.files}) == len(dataset.files)
    for file in dataset.files:
        assert re.fullmatch(r"[0-9a-f]{64}", file.sha256)
        assert " " not in dataset.url(file)


@pytest.mark.parametrize("name", DATASETS)
def test_the_real_files_are_the_published_ones(
    real: Path, name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("MISSING_PHYSICS_DATA", str(real))
    assert local_folder(name) == real / name
    # One flipped bit in a copy is noticed.
    first = DATASETS[name].files[0]
    copy = tmp_path / name
    shutil.copytree(real / name, copy, copy_function=shutil.copyfile)
    copy.chmod(0o755)
    content = bytearray((copy / first.name).read_bytes())
    content[len(content) // 2] ^= 1
    (copy / first.name).write_bytes(content)
    monkeypatch.setenv("MISSING_PHYSICS_DATA", str(tmp_path))
    with pytest.raises(InputError, match="is not the published file"):
        local_folder(name)


def test_commands(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    from typer.testing import CliRunner

    from missing_physics.cli import app

    listed = CliRunner().invoke(app, ["datasets", "list"])
    assert listed.exit_code == 0
    assert all(name in listed.stdout for name in DATASETS)
    folder = tmp_path / "mine" / "tiny"
    folder.mkdir(parents=True)
    for name, content in CONTENT.items():
        (folder / name).write_bytes(content)
    monkeypatch.setenv("MISSING_PHYSICS_DATA", str(tmp_path / "mine"))
    monkeypatch.setattr("missing_physics.cli.datasets.DATASETS", {"tiny": replace(TINY)})
    fetched = CliRunner().invoke(app, ["datasets", "fetch", "tiny"])
    assert fetched.stdout.splitlines() == [str(folder / name) for name in CONTENT]
