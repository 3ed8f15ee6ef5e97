"""Files with an excessive unpacked size are rejected by their declared size, unless the limit is raised."""

from __future__ import annotations

import json
import struct
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from missing_physics.cli import main
from missing_physics.recordings import load_mapping, load_recording, read_raw
from missing_physics.recordings.readers import SIZE_LIMIT, Budget
from missing_physics.recordings.readers.base import reading
from missing_physics.recordings.readers.source import Source
from robot_model import InputError, OutOfMemoryError

#: Samples of the files below, two columns, 8 bytes each; they are all zeros but for time.
COUNT = 200_000
TAKEN = 2 * 8 * COUNT
TIME = np.arange(COUNT) / 1000.0
ZEROS = np.zeros(COUNT)
COLUMNS = {"time": TIME, "joint1.position": ZEROS}


def parquet(path: Path) -> None:
    pq.write_table(pa.table(COLUMNS), path)


def parquet_of_lists(path: Path) -> None:
    lists = pa.FixedSizeListArray.from_arrays(pa.array(ZEROS), COUNT // 50)
    pq.write_table(pa.table({"time": pa.array(TIME[:50]), "joint1.position": lists}), path)


def parquet_of_text(path: Path) -> None:
    text = pa.array([f"{k:0100}" for k in range(COUNT // 50)])
    pq.write_table(pa.table({"time": text}), path, use_dictionary=False)


def mat5(path: Path) -> None:
    scipy.io.savemat(path, {"time": TIME, "joint1": {"position": ZEROS}}, do_compression=True)


def mat5_of_structures(path: Path) -> None:
    samples = np.zeros(COUNT // 400, dtype=[("t", object), ("q", object)])
    scipy.io.savemat(path, {"joint1": samples}, do_compression=True)


def mat5_of_text(path: Path) -> None:
    """What is passed over in a compressed variable is unpacked, too."""
    scipy.io.savemat(path, {"joint1": {"text": "a" * 4 * COUNT, "position": 1.0}}, do_compression=True)


def mat73(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("time", data=TIME, compression="gzip")
        file.create_dataset("joint1/position", shape=(COUNT,), dtype="f8")


def mat73_of_chunks(path: Path) -> None:
    with h5py.File(path, "w") as file:
        place = file.create_dataset("joint1/position", (50,), "f8", maxshape=(None,), chunks=(2 * COUNT,))
        place[:] = 0.0


def csv(path: Path) -> None:
    path.write_text("time,joint1.position\n" + "\n".join(f"{k / 1000},0" for k in range(COUNT)))


def csv_of_spaces(path: Path) -> None:
    path.write_text("time joint1.position\n" + "\n".join(f"{k}  0" for k in range(COUNT)))


def csv_of_text(path: Path) -> None:
    path.write_text("time,remark\n" + "\n".join(f"text{k},0" for k in range(COUNT // 10)))


def samples(path: Path) -> None:
    path.write_text(json.dumps([{"time": k, "joint1.position": 0} for k in range(COUNT // 20)]))


def sparse_samples(path: Path) -> None:
    """Every key is a column of its own, as long as there are samples."""
    path.write_text(json.dumps([{f"joint{k}.position": 0} for k in range(700)]))


BOMBS: dict[str, tuple[str, Callable[[Path], None]]] = {
    "Parquet": ("a.parquet", parquet),
    "Parquet of lists": ("a.parquet", parquet_of_lists),
    "Parquet of text": ("a.parquet", parquet_of_text),
    "NPZ": ("a.npz", lambda path: np.savez_compressed(path, **COLUMNS)),
    "NPZ of small integers": ("a.npz", lambda path: np.savez_compressed(path, time=ZEROS.astype("i1"))),
    "NPZ of structures": (
        "a.npz",
        lambda path: np.savez_compressed(path, time=np.zeros(COUNT, [("a", "i1", 2), ("b", "f4")])),
    ),
    "MAT 4": ("a.mat", lambda path: scipy.io.savemat(path, {"time": TIME}, format="4")),
    "MAT 5": ("a.mat", mat5),
    "MAT 5 of structures": ("a.mat", mat5_of_structures),
    "MAT 5 of text": ("a.mat", mat5_of_text),
    "MAT 7.3": ("a.mat", mat73),
    "MAT 7.3 of chunks": ("a.mat", mat73_of_chunks),
    "CSV": ("a.csv", csv),
    "CSV of spaces": ("a.csv", csv_of_spaces),
    "CSV of text": ("a.csv", csv_of_text),
    "JSON": ("a.json", samples),
    "JSON of many keys": ("a.json", sparse_samples),
}


@pytest.mark.parametrize("kind", BOMBS)
def test_declared_sizes_are_checked_against_the_limit(tmp_path: Path, kind: str) -> None:
    name, make = BOMBS[kind]
    make(tmp_path / name)
    with pytest.raises(InputError) as refused:
        read_raw(tmp_path / name, budget=Budget(0.15 * TAKEN))
    message = str(refused.value)
    assert name in message
    assert (
        "at most 0.00048 GB are read: keep fewer samples or columns, or allow more (--size-limit" in message
    )
    assert read_raw(tmp_path / name).variables


@pytest.mark.parametrize("kind", ["Parquet", "NPZ", "MAT 5", "MAT 7.3", "CSV"])
def test_size_limit_counts_the_memory_of_the_numbers(tmp_path: Path, kind: str) -> None:
    name, make = BOMBS[kind]
    make(tmp_path / name)
    slack = 1.1  # chunks of HDF5 are rounded up
    load_recording(tmp_path / name, size_limit=2 * slack * TAKEN if kind == "MAT 7.3" else slack * TAKEN)
    with pytest.raises(InputError, match="--size-limit"):
        load_recording(tmp_path / name, size_limit=0.99 * TAKEN)


@pytest.mark.parametrize("name", ["a.parquet", "a.npz", "a.mat"])
def test_unread_columns_do_not_count(tmp_path: Path, name: str) -> None:
    wide = {f"other{k}": ZEROS for k in range(9)} | {"time": TIME}
    path = tmp_path / name
    if name == "a.mat":
        scipy.io.savemat(path, wide, do_compression=True)
    elif name == "a.npz":
        np.savez_compressed(path, **wide)
    else:
        pq.write_table(pa.table(wide), path)
    tight = Budget(1.1 * TIME.nbytes)
    assert read_raw(path, want=lambda label: label == "time", budget=tight).variables.keys() == {"time"}


def test_joined_files_count_together(tmp_path: Path) -> None:
    np.savez(tmp_path / "one.npz", t=TIME)
    np.savez(tmp_path / "two.npz", q=ZEROS)
    (tmp_path / "map.toml").write_text(
        'join = ["two.npz"]\n[time]\nsource = "t"\n[channels."joint1.position"]\nsource = "q"\n'
    )
    mapping = load_mapping(tmp_path / "map.toml")
    assert len(load_recording(tmp_path / "one.npz", mapping=mapping, check=False)) == COUNT
    with pytest.raises(InputError, match=r"two\.npz declares q with 200000 entries.*what is read before it"):
        load_recording(tmp_path / "one.npz", mapping=mapping, check=False, size_limit=1.5 * ZEROS.nbytes)


def npz_of_a_lie(path: Path) -> None:
    """A header that declares what the archive does not hold."""
    stream = BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("time.npy", stream.getvalue())


def mat5_of_a_lie(path: Path) -> None:
    """Half a billion numbers, compressed, of which a few are there."""
    count = 500_000_000
    parts = (
        struct.pack("<IIII", 6, 8, 6, 0),
        struct.pack("<IIii", 5, 8, 1, count),
        struct.pack("<II8s", 1, 4, b"time"),
        struct.pack("<II", 9, 8 * count),
    )
    head = b"".join(parts)
    whole = struct.pack("<II", 14, len(head) + 8 * count) + head
    packed = zlib.compress(whole + bytes(800))
    path.write_bytes(
        b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(packed)) + packed
    )


def mat73_of_nothing(path: Path) -> None:
    """A dataset of which no number is stored: 1.6e9 of them in 2 kB."""
    with h5py.File(path, "w") as file:
        file.create_dataset("time", shape=(1_600_000_000,), dtype="f8")


def mat73_of_a_long_chunk(path: Path) -> None:
    """HDF5 inflates a chunk to whatever it holds."""
    with h5py.File(path, "w") as file:
        place = file.create_dataset("time", (1000,), "f8", chunks=(1000,), compression="gzip")
        place.id.write_direct_chunk((0,), zlib.compress(bytes(70 << 20), 1))


def mat73_of_another_file(path: Path) -> None:
    path.with_suffix(".raw").write_bytes(bytes(8000))
    with h5py.File(path, "w") as file:
        file.create_dataset("time", (1000,), "f8", external=[(str(path.with_suffix(".raw")), 0, 8000)])


@pytest.mark.parametrize(
    ("name", "make", "message"),
    [
        ("a.npz", npz_of_a_lie, "truncated or damaged"),
        ("a.mat", mat5_of_a_lie, "declares time with 1 x 500000000 entries, which takes 4 GB of memory"),
        ("a.mat", mat73_of_nothing, "declares time with 1600000000 entries, which takes 12.8 GB of memory"),
        ("a.mat", mat73_of_a_long_chunk, "a chunk that unpacks to more than it declares"),
        ("a.mat", mat73_of_another_file, "lies in another file"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_declared_but_absent_data_are_not_allocated(
    tmp_path: Path, name: str, make: Callable[[Path], None], message: str
) -> None:
    make(tmp_path / name)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=message):
            load_recording(tmp_path / name)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 10e6
    assert SIZE_LIMIT == 2e9


@pytest.mark.parametrize(
    ("command", "code"),
    [
        ("inspect a.npz --size-limit 0.001", 2),
        ("inspect a.npz --size-limit 0.002", 0),
        ("diagnose single_axis a.npz --size-limit 0.001", 2),
    ],
)
def test_the_commands_take_a_limit_in_gigabytes(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: str,
    code: int,
) -> None:
    monkeypatch.chdir(tmp_path)
    np.savez("a.npz", **{name: values[:70_000] for name, values in COLUMNS.items()})
    monkeypatch.setattr("sys.argv", ["x", *command.split()])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == code
    assert ("which takes 0.00112 GB of memory" in (message := capsys.readouterr().err)) == bool(code)
    assert message.count("\n") == bool(code)
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan")])
def test_invalid_size_limit_is_rejected(tmp_path: Path, limit: float) -> None:
    np.savez(tmp_path / "a.npz", time=TIME)
    with pytest.raises(InputError, match="give more than 0"):
        load_recording(tmp_path / "a.npz", size_limit=limit)


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        pa.lib.ArrowMemoryError("malloc of size 8589934592 failed"),
        OSError("Can't synchronously read data (memory allocation failed for inflate decompression)"),
        RuntimeError("std::bad_alloc"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_lack_of_memory_is_not_reported_as_damage(tmp_path: Path, error: Exception) -> None:
    source = Source(tmp_path / "a.npz", "a.npz", ".npz", Budget())
    with pytest.raises(OutOfMemoryError) as told, reading(source, "NPZ"):
        raise error
    assert str(told.value).startswith("a.npz takes more memory than is free")
