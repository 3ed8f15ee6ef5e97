"""Whatever bytes a reader is given, it returns a recording or raises InputError with one sentence."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
import tomli_w
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_np

from missing_physics.recordings import READERS, load_recording, mapping_from_toml, read_raw, write_recording
from missing_physics.recordings.apply import LARGEST, SMALLEST
from robot_model import InputError, Recording

#: The temporary folder is shared by the examples of one test: each overwrites the same file.
QUICK = settings(max_examples=60)

MAGIC = {
    ".parquet": b"PAR1",
    ".pq": b"PAR1",
    ".mat": b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM",
    ".npz": b"PK\x03\x04",
    ".json": b"[{",
    ".csv": b"time,joint1.position\n0,",
    ".tsv": b"time\tjoint1.position\n0\t",
    ".txt": b"time;joint1.position\n0;",
}


def refusal(call: Callable[[], object]) -> str | None:
    """The sentence with which `call` refuses its input, None when it does not; nothing else may be raised."""
    try:
        call()
    except InputError as error:
        return str(error)
    return None


def read_or_refuse(path: Path) -> None:
    sentence = refusal(lambda: load_recording(path))
    if sentence is not None:
        assert path.name in sentence
        assert sentence.endswith((".", "?"))
        assert "\n" not in sentence


def whole_files(folder: Path) -> list[Path]:
    """One valid file of every format."""
    t = np.arange(80) / 100.0
    columns = {"time": t, "joint1.position": np.sin(t)}
    np.savez(folder / "a.npz", **columns)
    np.savez_compressed(folder / "b.npz", **columns)
    pq.write_table(pa.table(columns), folder / "a.parquet")
    for name, squeeze in (("a.mat", False), ("b.mat", True)):
        scipy.io.savemat(
            folder / name, {"time": t, "joint1": {"position": np.sin(t)}}, do_compression=squeeze
        )
    with h5py.File(folder / "c.mat", "w") as file:
        file["time"], file["joint1/position"] = t, np.sin(t)
    (folder / "a.json").write_text(
        json.dumps([dict(zip(columns, map(float, row))) for row in zip(*columns.values())])
    )
    (folder / "a.csv").write_text("time,joint1.position\n" + "\n".join(f"{x},{np.sin(x)}" for x in t))
    return sorted(folder.iterdir())


@pytest.mark.parametrize("suffix", sorted(READERS))
@given(data=st.binary(max_size=400), with_magic=st.booleans())
@QUICK
def test_random_bytes(tmp_path: Path, suffix: str, data: bytes, with_magic: bool) -> None:
    path = tmp_path / f"random{suffix}"
    path.write_bytes(MAGIC[suffix] * with_magic + data)
    read_or_refuse(path)


@given(st.data())
@settings(QUICK, max_examples=250)
def test_truncated_and_flipped_files(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    folder = tmp_path_factory.getbasetemp() / "whole"
    if not folder.exists():
        folder.mkdir()
        whole_files(folder)
    source = data.draw(st.sampled_from(sorted(folder.iterdir())))
    content = bytearray(source.read_bytes())
    del content[data.draw(st.integers(1, len(content))) :]
    for _ in range(data.draw(st.integers(0, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    damaged = tmp_path_factory.getbasetemp() / f"damaged{source.suffix}"
    damaged.write_bytes(bytes(content))
    read_or_refuse(damaged)


@pytest.mark.parametrize("keep", [0.05, 0.5, 0.95])
def test_truncation_of_a_binary_file_is_seen(tmp_path: Path, keep: float) -> None:
    for path in whole_files(tmp_path):
        if path.suffix == ".csv":  # a table cut at the end of a row is a shorter table
            continue
        path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])
        with pytest.raises(InputError, match=rf"{path.name} .*truncated or damaged"):
            read_raw(path)


finite = st.floats(-LARGEST, LARGEST)
names = st.sampled_from(
    [
        "joint1.position",
        "joint1.torque",
        "joint2.velocity",
        "base.attitude.w",
        "link2.strain.3",
        "joint1.current",
    ]
)


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    count = draw(st.integers(50, 70))
    steps = draw(st_np.arrays(np.float64, count, elements=st.floats(1e-4, 0.1)))
    start = draw(st.floats(-1e3, 1e9))
    time = start + np.cumsum(steps)
    chosen = draw(st.lists(names, min_size=1, max_size=4, unique=True))
    values = st_np.arrays(np.float64, count, elements=st.one_of(finite, st.just(np.nan)))
    channels = {name: draw(values.filter(lambda y: not np.isnan(y).all())) for name in chosen}
    some = st.dictionaries(st.sampled_from(chosen), st.floats(1e-12, 1e3), max_size=2)
    if np.any(np.diff(time) <= 0):  # a late start swallows steps below its last bit
        time = np.arange(count) / 100.0
    return Recording(time=time, channels=channels, noise=draw(some), resolution=draw(some))


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
@given(recording=recordings())
@QUICK
def test_round_trip(tmp_path: Path, suffix: str, recording: Recording) -> None:
    path = tmp_path / f"trip{suffix}"
    write_recording(recording, path)
    back = load_recording(path, check=False)
    np.testing.assert_array_equal(back.time, recording.time)
    assert list(back) == list(recording)
    for name, values in recording.channels.items():
        resolved = np.where(np.abs(values) < SMALLEST, 0.0, values)
        np.testing.assert_array_equal(back[name], resolved)
    if suffix != ".csv":
        assert dict(back.noise) == dict(recording.noise)


words = st.sampled_from(
    ["time", "channels", "source", "rate", "row", "joint1.position", "scale", "terms", "a"]
)
values = st.recursive(
    st.one_of(st.integers(-2, 3), st.floats(), st.text(max_size=3), st.booleans()),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(words, inner, max_size=3)),
    max_leaves=8,
)


@given(st.dictionaries(words, values, max_size=4))
@example({"time": {"rate": 1.0}, "channels": {"joint1.position": {"terms": [{"source": "a", "scal": 1.0}]}}})
@QUICK
def test_random_mappings(content: dict[str, object]) -> None:
    sentence = refusal(lambda: mapping_from_toml(tomli_w.dumps(content), source="m.toml"))
    if sentence is not None:
        assert sentence.startswith("m.toml")
        assert "\n" not in sentence


@given(st.text(max_size=80))
@QUICK
def test_random_text_as_mapping(text: str) -> None:
    with pytest.raises(InputError, match=r"m\.toml"):
        mapping_from_toml(text, source="m.toml")
