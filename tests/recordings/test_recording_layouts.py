"""Layouts that labs have: lists in Parquet, one long column, no suffix, joined files, maps of their own."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from missing_physics.cli import main
from missing_physics.recordings import load_recording, mapping_from_toml, read_raw
from missing_physics.recordings.readers import Budget
from robot_model import InputError

N = 120
T = np.arange(N) / 100.0
STATE = np.stack([np.sin(T), np.cos(T), T], axis=1)
HEAD = 'time = { source = "timestamp" }\n'


def lerobot(path: Path, lists: pa.Array) -> Path:
    """LeRobot's columns: lists of joints, and numbers that count episodes and frames."""
    columns = {"observation.state": lists, "timestamp": T, "episode_index": np.zeros(N, int)}
    pq.write_table(pa.table(columns), path)
    return path


@pytest.mark.parametrize(
    "kind", [pa.list_(pa.float32()), pa.large_list(pa.float64()), pa.list_(pa.float32(), 3)]
)
def test_lists_in_parquet_are_selected_by_column(tmp_path: Path, kind: pa.DataType) -> None:
    path = lerobot(tmp_path / "episode_000000.parquet", pa.array(STATE.tolist(), type=kind))
    text = HEAD + '[channels."joint1.position"]\nsource = "observation.state"\ncolumn = 1\n'
    recording = load_recording(path, mapping=mapping_from_toml(text), check=False)
    np.testing.assert_allclose(recording["joint1.position"], np.cos(T), atol=1e-7)


def test_rows_without_a_list_are_missing_samples(tmp_path: Path) -> None:
    rows = [None if k in (0, 50) else row for k, row in enumerate(STATE.tolist())]
    found = read_raw(lerobot(tmp_path / "a.parquet", pa.array(rows)))["observation.state"]
    assert found.shape == (N, 3)
    assert np.flatnonzero(np.isnan(found).any(axis=1)).tolist() == [0, 50]
    np.testing.assert_array_equal(found[1:50], STATE[1:50])


def test_lists_of_different_lengths_are_rejected(tmp_path: Path) -> None:
    rows = STATE.tolist()
    rows[7] = rows[7][:2]
    path = lerobot(tmp_path / "a.parquet", pa.array(rows))
    with pytest.raises(InputError, match=r"'observation\.state', of 3 numbers first and of 2 in row 8"):
        read_raw(path)


def test_lists_count_towards_the_size_limit(tmp_path: Path) -> None:
    path = lerobot(tmp_path / "a.parquet", pa.array(STATE.tolist()))
    size = N * 5 * 8
    assert read_raw(path, budget=Budget(size)).variables
    with pytest.raises(InputError, match="declares 120 rows x 2 columns and 360 numbers in lists"):
        read_raw(path, budget=Budget(0.99 * size))


def test_one_long_column(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    path.write_text("\n".join(map(repr, STATE.ravel().tolist())))
    text = 'time = { source = "column1", reshape = [-1, 3], column = 2 }\n[channels."joint1.position"]\n'
    text += 'terms = [{ source = "column1", reshape = [%s], column = 0, scale = 2.0 }]'
    recording = load_recording(path, mapping=mapping_from_toml(text % "-1, 3"), check=False)
    np.testing.assert_array_equal(recording.time, T)
    np.testing.assert_array_equal(recording["joint1.position"], 2 * np.sin(T))
    with pytest.raises(InputError, match=r"has 360 numbers, which .* reshape = \[-1, 7\] does not fit"):
        load_recording(path, mapping=mapping_from_toml(text % "-1, 7"), check=False)
    with pytest.raises(InputError, match="reshape takes whole numbers, one of which may be -1"):
        mapping_from_toml(text % "-1, -1")


@pytest.mark.parametrize("kind", ["text", "numbers", "parquet", "npz", "mat", "h5", "json"])
def test_format_of_a_file_without_suffix_follows_from_its_first_bytes(tmp_path: Path, kind: str) -> None:
    path, columns = tmp_path / "log", {"time": T, "joint1.position": np.sin(T)}
    if kind == "text":
        path.write_text("time joint1.position\n" + "\n".join(f"{a} {b}" for a, b in zip(*columns.values())))
    elif kind == "numbers":
        path.write_text("\n".join(f"{a}\t{b}" for a, b in zip(*columns.values())))
    elif kind == "parquet":
        pq.write_table(pa.table(columns), path)
    elif kind == "npz":
        with path.open("wb") as file:
            np.savez(file, **columns)
    elif kind == "mat":
        scipy.io.savemat(path, {"time": T, "joint1": {"position": np.sin(T)}}, appendmat=False)
    elif kind == "h5":
        with h5py.File(path, "w") as file:
            file["time"], file["joint1/position"] = T, np.sin(T)
    else:
        path.write_text(json.dumps({name: values.tolist() for name, values in columns.items()}))
    raw = read_raw(path)
    values = raw["column2" if kind == "numbers" else "joint1.position"]
    np.testing.assert_allclose(values.ravel(), np.sin(T), rtol=1e-15)


def test_bag_without_a_suffix_is_rejected_with_the_required_name(tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(InputError, match=r"is a ROS bag without a suffix; call it log\.bag\."):
        read_raw(tmp_path / "log")


def test_hdf5_arrays_keep_their_shapes(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["robot/time"] = T
        file.create_dataset("robot/q", data=STATE, compression="gzip", chunks=(16, 3))
        file["remark"] = "a text"
    text = 'time = { source = "robot.time" }\n[channels."joint1.position"]\nsource = "robot.q"\ncolumn = 1'
    recording = load_recording(tmp_path / "a.h5", mapping=mapping_from_toml(text), check=False)
    np.testing.assert_array_equal(recording["joint1.position"], np.cos(T))


def test_joined_files_with_equal_headers_and_names_that_follow_the_recording(tmp_path: Path) -> None:
    text = """
        join = [
            { file = "{stem}_drive.csv", prefix = "drive" },
            { file = "{stem}_sensor.csv", prefix = "sensor" },
        ]
        [time]
        source = "t"
        [channels."joint1.position"]
        source = "x"
        [channels."joint1.torque"]
        source = "drive.x"
        [channels."joint1.temperature"]
        source = "sensor.x"
    """
    for run, size in (("one", 1.0), ("two", 2.0)):
        for name, factor in ((run, size), (f"{run}_drive", 10 * size), (f"{run}_sensor", 100 * size)):
            rows = "\n".join(f"{t},{factor * np.sin(t) + factor}" for t in T)
            (tmp_path / f"{name}.csv").write_text("t,x\n" + rows)
        recording = load_recording(tmp_path / f"{run}.csv", mapping=mapping_from_toml(text), check=False)
        for quantity, factor in (("position", size), ("torque", 10 * size), ("temperature", 100 * size)):
            np.testing.assert_allclose(recording[f"joint1.{quantity}"], factor * np.sin(T) + factor)


def test_each_recording_uses_the_map_next_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = 'time = {{ rate = 100 }}\n[channels."joint1.position"]\nsource = "x"\nscale = {}'
    for name, scale in (("one", 1.0), ("two", 2.0)):
        np.savez(tmp_path / f"{name}.npz", x=np.sin(T))
        (tmp_path / f"{name}.map.toml").write_text(text.format(scale))
        recording = load_recording(tmp_path / f"{name}.npz@0.1:", check=False)
        np.testing.assert_array_equal(recording["joint1.position"], scale * np.sin(T)[10:])
    given = mapping_from_toml(text.format(3.0))
    recording = load_recording(tmp_path / "one.npz", mapping=given, check=False)
    np.testing.assert_array_equal(recording["joint1.position"], 3 * np.sin(T))
    monkeypatch.setattr("sys.argv", ["x", "inspect", str(tmp_path / "one.npz"), "--quiet"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0
    assert "joint1" in capsys.readouterr().out
    (tmp_path / "one.map.toml").write_text("[time]\nrat = 1")
    with pytest.raises(InputError, match=r"one\.map\.toml: unknown key 'time\.rat'; did you mean 'rate'"):
        load_recording(tmp_path / "one.npz")
