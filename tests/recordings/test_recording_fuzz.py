"""For any bytes a reader returns a recording or raises InputError with one sentence."""

from __future__ import annotations

import json
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from functools import cache
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
import tomli_w
from bags_written import states, texts, write_bag
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_np
from quick_ones import quick_names

from missing_physics.recordings import READERS, load_recording, mapping_from_toml, read_raw, write_recording
from missing_physics.recordings.files.apply import LARGEST, SMALLEST
from robot_model import InputError, OutOfMemoryError, Recording

pytestmark = pytest.mark.fuzz

#: Fewer examples where each is read by processes of its own.
FEW = settings(max_examples=settings.default.max_examples // 6)

#: A table of text that is cut at the end of a row is a shorter table.
BINARY = (".mat", ".npz", ".parquet", ".pq", ".json", ".h5", ".bag", ".mcap", ".db3")
#: Files of which each is read by a process of its own, which takes its time.
APART = ("seven.mat", "eight.mat", "nine.h5", "one.bag", "packed.bag", "two.mcap", "three.db3")

MAGIC = {
    ".parquet": b"PAR1",
    ".pq": b"PAR1",
    ".mat": b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM",
    ".npz": b"PK\x03\x04",
    ".json": b"[{",
    ".h5": b"\x89HDF\r\n\x1a\n",
    ".bag": b"#ROSBAG V2.0\n",
    ".mcap": b"\x89MCAP0\r\n\x01\x0c" + bytes(7) + b"\x04\0\0\0ros2",
    ".db3": b"SQLite format 3\0",
    ".csv": b"time,joint1.position\n0,",
    ".tsv": b"time\tjoint1.position\n0\t",
    ".txt": b"time;joint1.position\n0;",
    ".dat": b"0 1\n0.01 ",
}


def refusal(call: Callable[[], object]) -> str | None:
    """The sentence with which `call` refuses its input, None when it does not; nothing else may be raised.

    Too little memory is no fault of the input; a damaged number may ask for any amount.
    """
    try:
        call()
    except (InputError, OutOfMemoryError) as error:
        return str(error)
    return None


def read_or_refuse(path: Path) -> None:
    """Read all variables, and as a recording."""
    check_sentence(path, refusal(lambda: read_raw(path)))
    check_sentence(path, refusal(lambda: load_recording(path)))


def check_sentence(path: Path, sentence: str | None) -> None:
    if sentence is not None:
        assert path.name in sentence
        assert sentence.endswith((".", "?"))
        assert "\n" not in sentence


T = np.arange(80) / 100.0
COLUMNS = {"time": T, "joint1.position": np.sin(T)}


def whole_tables(folder: Path) -> None:
    """Valid text files and tables of several forms."""
    rows = [f"{x},{np.sin(x)}" for x in T]
    (folder / "a.csv").write_text("time,joint1.position\n" + "\n".join(rows))
    (folder / "b.txt").write_text(
        "# log\ntime joint1.position\n" + "\n".join(r.replace(",", " ") for r in rows)
    )
    (folder / "c.tsv").write_text("\n".join(r.replace(",", ";").replace(".", ",") for r in rows))
    samples = [dict(zip(COLUMNS, map(float, row))) for row in zip(*COLUMNS.values())]
    (folder / "a.json").write_text(json.dumps(samples))
    (folder / "b.json").write_text(json.dumps({"kp": 2, "log": samples, "v": [[1, 2]] * 80}))
    table = pa.table(COLUMNS)
    text = pa.array([f"2026-01-01T00:00:00.{k:03}" for k in range(80)])
    lists = pa.FixedSizeListArray.from_arrays(pa.array(np.arange(160.0)), 2)
    pq.write_table(table, folder / "a.parquet")
    pq.write_table(table, folder / "b.parquet", compression="zstd", use_dictionary=False)
    pq.write_table(pa.table({"time": T, "joint1.position": pa.array([[x] for x in T])}), folder / "d.parquet")
    pq.write_table(pa.table({"time": text, "joint1.position": lists}), folder / "c.pq")


def whole_arrays(folder: Path) -> None:
    """Valid files of arrays, compressed and not, with structures in them."""
    structured = np.zeros(80, [("time", "f8"), ("q", "i2", 2)])
    np.savez(folder / "a.npz", **COLUMNS)
    np.savez_compressed(folder / "b.npz", **COLUMNS, s=structured, **{"noise/joint1.position": np.array(0.1)})
    cells = np.array([T, "text", np.zeros((2, 3, 4), "i2"), None], dtype=object)[:-1]
    samples = np.zeros(3, [("a", object), ("b", object)])
    many = {"time": T, "joint1": {"position": np.sin(T), "deep": {"x": 1.0}}, "c": cells, "s": samples}
    scipy.io.savemat(folder / "four.mat", {"time": T, "q": np.sin(T), "text": "abc"}, format="4")
    scipy.io.savemat(folder / "five.mat", many)
    scipy.io.savemat(folder / "six.mat", many, do_compression=True)
    with h5py.File(folder / "seven.mat", "w") as file:
        file["time"], file["joint1/position"] = T, np.sin(T)
    with h5py.File(folder / "eight.mat", "w", userblock_size=512) as file:
        packed = {"compression": "gzip", "shuffle": True, "fletcher32": True}
        file.create_dataset("time", data=T, chunks=(16,), **packed)
        file.create_dataset("joint1/position", data=np.sin(T), **packed)
        file["joint1"].attrs["MATLAB_class"] = np.bytes_("struct")
    with h5py.File(folder / "nine.h5", "w") as file:
        file["time"], file["joint1.position"] = T, np.sin(T)


def whole_bags(folder: Path) -> None:
    """Valid ROS bags of both versions, in every container."""
    for name in ("one.bag", "packed.bag", "two.mcap", "three.db3"):
        write_bag(folder / name, states() + texts(), packed="chunk" * name.startswith("packed"))


@cache
def whole_files() -> Mapping[str, bytes]:
    """The bytes of valid files of every format, by name."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        whole_tables(folder)
        whole_arrays(folder)
        whole_bags(folder)
        return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


#: What lengths, counts and offsets are set to.
EXTREMES = st.sampled_from([0, 1, 7, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1])


def damage(content: bytes, data: st.DataObject) -> bytes:
    """The content with bytes changed, removed or doubled, words set to extremes, or its end cut off."""
    damaged = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, max(len(damaged) - 1, 0)))
        kind = data.draw(st.sampled_from(["byte", "word", "double", "remove", "cut", "zeros"]))
        if kind == "byte":
            damaged[place : place + 1] = bytes([data.draw(st.integers(0, 255))])
        elif kind in ("word", "zeros"):
            width = data.draw(st.sampled_from([4, 8]))
            value = data.draw(EXTREMES) if kind == "word" else 0
            aligned = place - place % width
            order = data.draw(st.sampled_from(["little", "big"]))
            damaged[aligned : aligned + width] = (value % 256**width).to_bytes(width, order)
        elif kind == "double":
            damaged[place:place] = damaged[place : place + data.draw(st.integers(1, 24))]
        elif kind == "remove":
            del damaged[place : place + data.draw(st.integers(1, 24))]
        else:
            del damaged[place:]
    return bytes(damaged) or b"\0"


def damaged_inside(name: str, content: bytes, data: st.DataObject) -> bytes:
    """The same, done to what is compressed, which is compressed again, so that its checksum is right."""
    if name.endswith(".npz"):
        stream = BytesIO()
        with zipfile.ZipFile(BytesIO(content)) as old, zipfile.ZipFile(stream, "w") as new:
            for member in old.namelist():
                new.writestr(member, damage(old.read(member), data))
        return stream.getvalue()
    made, at = bytearray(content[:128]), 128
    while at < len(content):
        kind, length = struct.unpack_from("<II", content, at)
        element = content[at + 8 : at + 8 + length]
        at += 8 + length
        if kind == 15:
            element = zlib.compress(damage(zlib.decompress(element), data))
        made += struct.pack("<II", kind, len(element)) + element
    return bytes(made)


APART_SUFFIXES = (".h5", ".bag", ".mcap", ".db3")
DOUBLES = (".hdf5", ".hdf")


@pytest.mark.parametrize("suffix", sorted(set(READERS) - {*APART_SUFFIXES, *DOUBLES}))
@given(data=st.binary(max_size=400), with_magic=st.booleans())
def test_random_bytes(tmp_path: Path, suffix: str, data: bytes, with_magic: bool) -> None:
    path = tmp_path / f"random{suffix}"
    path.write_bytes(MAGIC[suffix] * with_magic + data)
    read_or_refuse(path)


@pytest.mark.parametrize("suffix", quick_names(APART_SUFFIXES, ".mcap"))
@given(data=st.binary(max_size=400), with_magic=st.booleans())
@FEW
def test_random_bytes_in_a_separate_process_are_read_or_rejected(
    tmp_path: Path, suffix: str, data: bytes, with_magic: bool
) -> None:
    path = tmp_path / f"random{suffix}"
    path.write_bytes(MAGIC[suffix] * with_magic + data)
    read_or_refuse(path)


@pytest.mark.parametrize("name", [name for name in whole_files() if name not in APART])
@given(data=st.data())
def test_damaged_files(tmp_path: Path, name: str, data: st.DataObject) -> None:
    path = tmp_path / name
    path.write_bytes(damage(whole_files()[name], data))
    read_or_refuse(path)


@pytest.mark.parametrize("name", quick_names(APART, "eight.mat", "packed.bag", "two.mcap", "three.db3"))
@given(data=st.data())
@FEW
def test_damaged_files_in_a_separate_process_are_read_or_rejected(
    tmp_path: Path, name: str, data: st.DataObject
) -> None:
    path = tmp_path / name
    path.write_bytes(damage(whole_files()[name], data))
    read_or_refuse(path)


@pytest.mark.parametrize("name", ["b.npz", "six.mat"])
@given(data=st.data())
def test_damaged_compressed_contents_are_read_or_rejected(
    tmp_path: Path, name: str, data: st.DataObject
) -> None:
    path = tmp_path / name
    path.write_bytes(damaged_inside(name, whole_files()[name], data))
    read_or_refuse(path)


@pytest.mark.parametrize(
    ("name", "keep"),
    [
        pytest.param(name, keep, marks=pytest.mark.proof if name in APART and keep != 0.5 else ())
        for name in whole_files()
        for keep in (0.05, 0.5, 0.95)
        if Path(name).suffix in BINARY
    ],
)
def test_truncation_of_a_binary_file_is_detected(tmp_path: Path, name: str, keep: float) -> None:
    path = tmp_path / name
    path.write_bytes(whole_files()[name][: int(keep * len(whole_files()[name]))])
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
    [
        "time",
        "channels",
        "source",
        "rate",
        "row",
        "joint1.position",
        "scale",
        "terms",
        "servo",
        "clip",
        "goal",
        "gain",
        "a",
    ]
)
values = st.recursive(
    st.one_of(st.integers(-2, 3), st.floats(), st.text(max_size=3), st.booleans()),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(words, inner, max_size=3)),
    max_leaves=8,
)


@given(st.dictionaries(words, values, max_size=4))
@example({"time": {"rate": 1.0}, "channels": {"joint1.position": {"terms": [{"source": "a", "scal": 1.0}]}}})
def test_random_mappings(content: dict[str, object]) -> None:
    sentence = refusal(lambda: mapping_from_toml(tomli_w.dumps(content), source="m.toml"))
    if sentence is not None:
        assert sentence.startswith("m.toml")
        assert "\n" not in sentence


@given(st.text(max_size=80))
def test_random_text_as_mapping(text: str) -> None:
    with pytest.raises(InputError, match=r"m\.toml"):
        mapping_from_toml(text, source="m.toml")
