"""Datasets: the user's folder first, checksums always, nothing left behind by a bad download. No network."""

from __future__ import annotations

import hashlib
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from missing_physics.recordings.datasets import (
    DATASETS,
    DataFile,
    Dataset,
    dataset_files,
    fetch,
    fetch_dataset,
    find_dataset,
    local_folder,
)
from robot_model import InputError


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


CONTENT = {"one.mat": b"first", "two words.mat": b"second"}
TINY = Dataset(
    name="tiny",
    what="two little files",
    repository="some/where",
    commit="0" * 40,
    licence="MIT",
    citation="Some One, 2020",
    files=tuple(DataFile(n, sha256(c), path=f"data/{n}") for n, c in CONTENT.items()),
)
#: The same with a file that may be had with fewer digits, and one prepared file in place of two published.
MIXED = Dataset(
    name="mixed",
    what="files in two layouts",
    repository="some/where",
    commit="0" * 40,
    licence="MIT",
    citation="Some One, 2020",
    files=(
        DataFile("one.mat", sha256(b"first"), path="data/one.mat", copies=(sha256(b"frst"),)),
        DataFile("both.csv", sha256(b"joined"), layout="prepared"),
        DataFile("part/two words.mat", sha256(b"second"), path="two words.mat", layout="published"),
    ),
)


@pytest.fixture(autouse=True)
def _tiny(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(fetch, "DATASETS", {**DATASETS, "tiny": TINY, "mixed": MIXED})
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


def test_downloaded_files_are_found_in_the_cache() -> None:
    assert find_dataset("tiny") is None
    folder = fetch_dataset("tiny", downloader=Downloader())
    assert find_dataset("tiny") == folder
    (folder / "one.mat").unlink()
    assert find_dataset("tiny") is None


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


def mixed_folder(folder: Path, content: dict[str, bytes], monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MISSING_PHYSICS_DATA", str(folder))
    for name, data in content.items():
        (folder / "mixed" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "mixed" / name).write_bytes(data)
    return folder / "mixed"


def test_a_known_copy_with_fewer_digits_is_accepted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = {"one.mat": b"frst", "part/two words.mat": b"second"}
    folder = mixed_folder(tmp_path, content, monkeypatch)
    assert local_folder("mixed") == folder
    (folder / "one.mat").write_bytes(b"frt")
    with pytest.raises(InputError, match=r"one\.mat is not the published file, nor a known copy"):
        local_folder("mixed")


def test_prepared_files_replace_the_published_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = mixed_folder(tmp_path, {"one.mat": b"first", "both.csv": b"joined"}, monkeypatch)
    assert local_folder("mixed") == folder
    assert [file.name for file in dataset_files("mixed", folder)] == ["one.mat", "both.csv"]
    (folder / "both.csv").write_bytes(b"joined otherwise")
    with pytest.raises(InputError, match=r"both\.csv is not the published file"):
        local_folder("mixed")


def test_only_published_files_are_downloaded(tmp_path: Path) -> None:
    downloader = Downloader()
    folder = fetch_dataset("mixed", downloader=downloader)
    assert [url.rpartition("/")[2] for url in downloader.urls] == ["one.mat", "two%20words.mat"]
    assert (folder / "part" / "two words.mat").read_bytes() == b"second"
    assert [file.name for file in dataset_files("mixed", folder)] == ["one.mat", "part/two words.mat"]


def test_mixed_dataset_layouts_are_rejected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mixed_folder(tmp_path, {"both.csv": b"joined", "part/two words.mat": b"second"}, monkeypatch)
    assert local_folder("mixed") is None


def test_unknown_name() -> None:
    with pytest.raises(InputError, match="did you mean 'kuka_kr300'"):
        fetch_dataset("kuka_kr30")


@pytest.mark.parametrize("dataset", DATASETS.values(), ids=lambda d: d.name)
def test_registry_is_pinned(dataset: Dataset) -> None:
    assert re.fullmatch(r"[0-9a-f]{40}", dataset.commit)
    assert dataset.licence
    assert dataset.citation
    assert len({f.name for f in dataset.files}) == len(dataset.files)
    for file in dataset.files:
        assert all(re.fullmatch(r"[0-9a-f]{64}", checksum) for checksum in file.accepted)
        assert file.layout in (None, *dataset.layouts)
        # A prepared file is the only one that need not be there to be downloaded.
        assert bool(file.path) == (file.layout != "prepared")
        assert " " not in dataset.url(file)


@pytest.mark.parametrize("name", DATASETS)
def test_the_real_files_are_the_published_ones(
    real: Path, name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("MISSING_PHYSICS_DATA", str(real))
    assert local_folder(name) == real / name
    # One flipped bit in a copy is noticed.
    listed = dataset_files(name, real / name)
    first = min(listed, key=lambda file: (real / name / file.name).stat().st_size)
    copy = tmp_path / name
    for file in listed:
        (copy / file.name).parent.mkdir(parents=True, exist_ok=True)
        (copy / file.name).symlink_to(real / name / file.name)
    (copy / first.name).unlink()
    shutil.copyfile(real / name / first.name, copy / first.name)
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
    told = " ".join(listed.stdout.split())  # lines are broken to the terminal's width
    for name, dataset in DATASETS.items():
        assert all(
            word in told for word in (name, f"licence: {dataset.licence}", f"cite: {dataset.citation}")
        )
    folder = tmp_path / "mine" / "tiny"
    folder.mkdir(parents=True)
    for name, content in CONTENT.items():
        (folder / name).write_bytes(content)
    monkeypatch.setenv("MISSING_PHYSICS_DATA", str(tmp_path / "mine"))
    monkeypatch.setattr("missing_physics.cli.commands.datasets.DATASETS", {"tiny": replace(TINY)})
    fetched = CliRunner().invoke(app, ["datasets", "fetch", "tiny"])
    assert fetched.stdout.splitlines() == [str(folder / name) for name in CONTENT]
