"""Every reader returns the written numbers, for any form of the file."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from missing_physics.recordings import load_recording, read_raw, readers, write_recording
from robot_model import InputError, Recording

N = 60
TIME = np.arange(N) / 100.0
# One fast and one slow column, so that swapped columns or shifted rows show.
COLUMNS = {
    "time": TIME,
    "joint1.position": np.sin(3 * TIME),
    "joint1.torque": np.cos(5 * TIME) * 1e3 + 1 / 3,
}


def write_csv(path: Path) -> None:
    rows = [",".join(COLUMNS), *(",".join(map(repr, map(float, row))) for row in zip(*COLUMNS.values()))]
    path.write_text("\n".join(rows) + "\n")


def write_json(path: Path) -> None:
    samples = [dict(zip(COLUMNS, map(float, row))) for row in zip(*COLUMNS.values())]
    path.write_text(json.dumps(samples))


def write_mat5(path: Path) -> None:
    joint = {"position": COLUMNS["joint1.position"], "torque": COLUMNS["joint1.torque"]}
    scipy.io.savemat(path, {"time": TIME, "joint1": joint})


def write_mat73(path: Path) -> None:
    """As MATLAB does: a header in the user block, and arrays with their axes reversed."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["time"] = TIME[None, :]
        for name in ("position", "torque"):
            file[f"joint1/{name}"] = COLUMNS[f"joint1.{name}"][None, :]
            file[f"joint1/{name}"].attrs["MATLAB_class"] = np.bytes_("double")
        file["title"] = np.frombuffer("abc".encode("utf-16-le"), dtype=np.uint16)
        file["title"].attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, written by a test".ljust(116))


WRITERS: dict[str, Callable[[Path], None]] = {
    "a.csv": write_csv,
    "a.json": write_json,
    "five.mat": write_mat5,
    "seven.mat": write_mat73,
    "a.npz": lambda path: np.savez(path, **COLUMNS),
    "a.parquet": lambda path: pq.write_table(pa.table(COLUMNS), path),
}


@pytest.mark.parametrize("name", WRITERS)
def test_native_names_need_no_mapping(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    recording = load_recording(tmp_path / name)
    assert list(recording) == ["joint1.position", "joint1.torque"]
    # Exact: every format carries float64, and CSV and JSON are written with all digits.
    np.testing.assert_array_equal(recording.time, TIME)
    for channel in recording:
        np.testing.assert_array_equal(recording[channel], COLUMNS[channel])


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
def test_written_recordings_are_read_back_exactly(tmp_path: Path, swing: Recording, suffix: str) -> None:
    noisy = Recording(
        time=swing.time * (1 + 1e-9),
        channels={**swing.channels, "joint1.temperature": np.where(swing.time < 1, np.nan, 293.15)},
        noise={"joint1.torque": 0.1 + 0.2},
        resolution={"joint1.position": 1e-5 / 3},
    )
    path = tmp_path / f"deep/er/r{suffix}"
    write_recording(noisy, path)
    back = load_recording(path)
    np.testing.assert_array_equal(back.time, noisy.time)
    for channel in noisy:
        np.testing.assert_array_equal(back[channel], noisy[channel])
    if suffix != ".csv":
        assert dict(back.noise) == dict(noisy.noise)
        assert dict(back.resolution) == dict(noisy.resolution)
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_unknown_format_to_write(tmp_path: Path, swing: Recording) -> None:
    with pytest.raises(InputError, match="can be written as"):
        write_recording(swing, tmp_path / "r.xlsx")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("delimiter", "decimal", "before"),
    [(",", ".", ""), (";", ".", ""), ("\t", ".", ""), (";", ",", ""), (",", ".", "# a comment\n% more\n\n")],
)
def test_forms_of_csv(tmp_path: Path, delimiter: str, decimal: str, before: str) -> None:
    lines = [delimiter.join(f'"{name}"' for name in COLUMNS)]
    for row in zip(*COLUMNS.values()):
        lines.append(delimiter.join(repr(float(x)).replace(".", decimal) for x in row))
    path = tmp_path / "a.csv"
    path.write_bytes(b"\xef\xbb\xbf" * (not before) + (before + "\r\n".join(lines)).encode())
    recording = load_recording(path)
    for channel in recording:
        np.testing.assert_array_equal(recording[channel], COLUMNS[channel])


def test_csv_without_header_has_numbered_columns(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("0.5,1\n0.25,2\n")
    raw = read_raw(path)
    assert raw.names == ("column1", "column2")
    np.testing.assert_array_equal(raw["column1"], [0.5, 0.25])


@pytest.mark.parametrize("header", ["", "time joint1.position\n"])
def test_spaces_between_cells(tmp_path: Path, header: str) -> None:
    path = tmp_path / "a.txt"
    path.write_text(header + "".join(f"  {i / 100:8.3f}   {-i:5d} \n" for i in range(N)))
    raw = read_raw(path)
    assert raw.names == (("time", "joint1.position") if header else ("column1", "column2"))
    np.testing.assert_array_equal(raw[raw.names[1]], -np.arange(N))
    path.write_text(path.read_text() + "1.0\n")
    with pytest.raises(InputError, match=rf"1 cells in row {N + 1 + bool(header)} where 2 are expected"):
        read_raw(path)


@pytest.mark.parametrize("header", ["", "a\tb\n", "a\tb\t\n"])
def test_trailing_delimiters_make_no_column(tmp_path: Path, header: str) -> None:
    path = tmp_path / "a.txt"
    path.write_text(header + "".join(f"{i}\t{-i}\t\n" for i in range(N)))
    raw = read_raw(path)
    assert raw.names == (("a", "b") if header else ("column1", "column2"))
    np.testing.assert_array_equal(raw[raw.names[1]], -np.arange(N))


def test_empty_last_cell_is_not_a_trailing_delimiter(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("a,b\n1,\n2,3\n")
    np.testing.assert_array_equal(read_raw(path)["b"], [np.nan, 3.0])


def test_lines_before_the_table_are_skipped(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("start, rate\n90, 1000 \n" + "".join(f"{i}\n" for i in range(N)))
    np.testing.assert_array_equal(read_raw(path, skip_lines=2)["column1"], np.arange(N))
    np.savez(tmp_path / "a.npz", q=np.arange(N))
    with pytest.raises(InputError, match=r"a\.npz is no text file; take skip_lines out of the map"):
        read_raw(tmp_path / "a.npz", skip_lines=2)


def test_csv_with_a_header_of_a_quarter_megabyte(tmp_path: Path) -> None:
    columns = 5000
    more = [f"a_long_name_of_a_column_that_is_not_used_{k:05}" for k in range(columns)]
    rows = [",".join([*map(repr, map(float, row)), *["0"] * columns]) for row in zip(*COLUMNS.values())]
    path = tmp_path / "a.csv"
    path.write_text(",".join([*COLUMNS, *more]) + "\n" + "\n".join(rows))
    recording = load_recording(path)
    np.testing.assert_array_equal(recording["joint1.torque"], COLUMNS["joint1.torque"])


def test_csv_with_an_extremely_long_line_is_rejected(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x" * 2**24)
    with pytest.raises(InputError, match="a line of more than 17 million characters"):
        load_recording(tmp_path / "a.csv")


def test_structured_arrays_of_npz_are_found_by_their_fields(tmp_path: Path) -> None:
    log = np.zeros(3, [("t", "f8"), ("q", [("x", "i2", 2)])])
    log["t"], log["q"]["x"] = [0.1, 0.2, 0.3], [[1, 2], [3, 4], [5, 6]]
    np.savez(tmp_path / "a.npz", log=log, other=log)
    raw = read_raw(tmp_path / "a.npz", want=lambda name: name in ("log.t", "log.q.x"))
    np.testing.assert_array_equal(raw["log.t"], log["t"])
    np.testing.assert_array_equal(raw["log.q.x"], log["q"]["x"])
    assert raw.names == ("log", "log.t", "log.q.x", "other", "other.t", "other.q.x")
    assert "other.t" not in raw.variables


def test_text_columns_of_parquet_however_they_are_stored(tmp_path: Path) -> None:
    text = pa.array(["a", None, "b", "a"])
    whole = pa.table(
        {"plain": text, "coded": text.dictionary_encode(), "large": text.cast(pa.large_string())}
    )
    for coded in (True, False):
        pq.write_table(whole, tmp_path / "a.parquet", use_dictionary=coded, row_group_size=2)
        raw = read_raw(tmp_path / "a.parquet")
        assert [raw[name].tolist() for name in raw.names] == [["a", None, "b", "a"]] * 3


def test_cells_that_are_empty_are_missing(tmp_path: Path) -> None:
    rows = [f"{i / 100},{'' if i % 7 else i}" for i in range(N)]
    path = tmp_path / "a.csv"
    path.write_text("time,joint1.position\n" + "\n".join(rows))
    values = load_recording(path)["joint1.position"]
    assert np.isnan(values).sum() == sum(1 for i in range(N) if i % 7)


def test_text_cell_is_reported_with_file_column_and_row(tmp_path: Path) -> None:
    rows = [f"{i / 100},{'overload' if i == 40 else i}" for i in range(N)]
    path = tmp_path / "a.csv"
    path.write_text("time,joint1.position\n" + "\n".join(rows))
    # Sample 40 counted from 0 stands in line 42 of the file.
    with pytest.raises(InputError, match=r"a\.csv has 'overload'.*column 'joint1.position', row 42"):
        load_recording(path)


def test_text_in_an_unused_column_is_ignored(tmp_path: Path) -> None:
    rows = [f"{i / 100},{i % 9},ok" for i in range(N)]
    path = tmp_path / "a.csv"
    path.write_text("time,joint1.position,remark\n" + "\n".join(rows))
    assert list(load_recording(path)) == ["joint1.position"]


def test_numbers_below_any_sensor_resolution_become_zero(tmp_path: Path) -> None:
    """Squares of squares of them would vanish; a coarse number beside them stays as it is."""
    path = tmp_path / "a.csv"
    rows = [f"{k / 100},{1e-160 * k},{1e-59 * k},{np.nan if k == 7 else 3}" for k in range(60)]
    path.write_text("\n".join(["time,joint1.torque,joint2.torque,joint3.torque", *rows]))
    recording = load_recording(path)
    assert not recording["joint1.torque"].any()
    assert np.count_nonzero(recording["joint2.torque"]) == 59
    assert np.isnan(recording["joint3.torque"]).sum() == 1


def test_ragged_row_is_named(tmp_path: Path) -> None:
    rows = [f"{i / 100},{i}" + (",7" if i == 30 else "") for i in range(N)]
    path = tmp_path / "a.csv"
    path.write_text("time,joint1.position\n" + "\n".join(rows))
    with pytest.raises(InputError, match=r"3 cells in row 32 where 2 are expected"):
        load_recording(path)


def test_number_types_that_widen_along_the_file_are_read(tmp_path: Path) -> None:
    """Types are inferred from a first block; a later block must not be cut to them."""
    count = 200_000
    values = np.zeros(count)
    values[-1] = 0.5
    path = tmp_path / "a.csv"
    path.write_text("time,joint1.position\n" + "\n".join(f"{i},{v:g}" for i, v in enumerate(values)))
    np.testing.assert_array_equal(load_recording(path, check=False)["joint1.position"], values)


def test_json_forms(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(
        '{"kp": 7, "on": true, "entries": [{"a": 1, "p": {"x": 2}, "v": [1, 2]}, {"a": null, "v": [3, 4]}]}'
    )
    raw = read_raw(path)
    assert raw["kp"].shape == ()
    assert raw["kp"] == 7
    np.testing.assert_array_equal(raw["entries.a"], [1, np.nan])
    np.testing.assert_array_equal(raw["entries.p.x"], [2, np.nan])
    np.testing.assert_array_equal(raw["entries.v"], [[1, 2], [3, 4]])
    path.write_text('{"a": [1, 2], "b": [0.5, 1.5]}')
    np.testing.assert_array_equal(read_raw(path)["b"], [0.5, 1.5])


def test_python_objects_in_npz_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, time=np.array([{"a": 1}], dtype=object))
    with pytest.raises(InputError, match=r"cannot be read as NPZ.*allow_pickle"):
        load_recording(path)


def test_matlab_shapes_and_structures(tmp_path: Path) -> None:
    table = np.arange(12.0).reshape(3, 4)
    samples = np.array([(1.0, 2.0), (3.0, 4.0)], dtype=[("a", object), ("b", object)])
    scipy.io.savemat(
        tmp_path / "a.mat", {"rec": {"table": table, "deep": {"x": 5.0}}, "s": samples, "t": "text"}
    )
    with h5py.File(tmp_path / "b.mat", "w") as file:
        file["rec/table"] = table.T
    five, seven = read_raw(tmp_path / "a.mat"), read_raw(tmp_path / "b.mat")
    np.testing.assert_array_equal(five["rec.table"], table)
    np.testing.assert_array_equal(seven["rec.table"], table)
    assert five["rec.deep.x"].item() == 5.0
    np.testing.assert_array_equal(five["s.b"], [2.0, 4.0])
    assert "t" not in five.variables


def test_misspelt_channel_is_rejected_with_a_suggestion(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", time=TIME, **{"joint1.positon": TIME})
    with pytest.raises(InputError, match=r"did you mean 'joint1\.position'\?"):
        load_recording(tmp_path / "a.npz")


def test_other_dotted_columns_are_kept(tmp_path: Path) -> None:
    np.savez(
        tmp_path / "a.npz", time=TIME, **{"joint1.position": np.sin(TIME), "link2.modal_coordinate.1": TIME}
    )
    assert "link2.modal_coordinate.1" in load_recording(tmp_path / "a.npz")


@pytest.mark.parametrize("reader", ["bags", "hdf5"])
def test_a_reading_process_imports_its_library_and_no_other_reader(reader: str) -> None:
    """It starts anew for each file: with all readers it would spend most of its time on imports."""
    program = str(Path(*readers.__path__, reader, "program.py"))
    code = (
        f"import runpy, sys; runpy.run_path({program!r}, run_name='program')\n"
        "print(*(name for name in sys.modules if name.split('.')[0] in ('missing_physics', 'scipy')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == {
        "missing_physics",
        "missing_physics.isolation",
        "missing_physics.isolation.limits",
    }
