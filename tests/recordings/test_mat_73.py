"""MAT 7.3 is read in a separate process, whose failures give one sentence."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest

from missing_physics.recordings import read_raw
from missing_physics.recordings.readers.hdf5 import datasets, program
from robot_model import InputError, OutOfMemoryError

TIME = np.arange(80) / 100.0

LISTED = """
import json, os, resource, signal, sys, time
print(json.dumps({"datasets": [{"name": "time", "shape": [2], "entry": 8, "chunk": 0}]}), flush=True)
sys.stdin.readline()
"""
SENT = 'print(json.dumps({"shape": [2], "type": "<f8"}), flush=True)\n'


@pytest.fixture
def whole(tmp_path: Path) -> Path:
    """A file with a compressed dataset in several chunks."""
    path = tmp_path / "whole.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        packed = {"compression": "gzip", "shuffle": True, "fletcher32": True}
        file.create_dataset("time", data=TIME, chunks=(16,), **packed)
        file["joint1/position"] = np.sin(TIME)
    return path


def damaged(path: Path) -> None:
    """The first chunk of no length in the file, which HDF5 takes a checksum from all the same."""
    content = bytearray(path.read_bytes())
    place = content.index(b"TREE\x01") + 24  # behind the head of the tree of chunks
    content[place : place + 4] = bytes(4)
    path.write_bytes(content)


def test_files_that_crash_the_hdf5_library_give_one_sentence(whole: Path) -> None:
    damaged(whole)
    command = [sys.executable, "-m", "missing_physics", "inspect", str(whole)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    assert "it may be truncated or damaged" in done.stderr
    assert "Traceback" not in done.stderr


def test_damaged_variable_does_not_prevent_reading_the_others(whole: Path) -> None:
    damaged(whole)
    found = read_raw(whole, want=lambda name: name != "time")
    np.testing.assert_array_equal(found["joint1.position"], np.sin(TIME))
    assert set(found.names) == {"time", "joint1.position"}


def test_numbers_are_transferred_unchanged(tmp_path: Path) -> None:
    shapes, kinds = [(), (0,), (3, 0), (2, 3, 4)], ["<f8", ">f4", "i2", ">u8", "?"]
    chance = np.random.default_rng(1)
    written = {
        f"{kind[-2:].strip('<>')}_{k}": chance.integers(0, 200, shape).astype(kind)
        for kind in kinds
        for k, shape in enumerate(shapes)
    }
    with h5py.File(tmp_path / "a.mat", "w") as file:
        for name, values in written.items():
            file[name] = values
    found = read_raw(tmp_path / "a.mat").variables
    assert found.keys() == written.keys()
    for name, values in written.items():
        np.testing.assert_array_equal(found[name], values.T)
        assert (found[name].dtype.kind, found[name].dtype.itemsize) == (
            values.dtype.kind,
            values.dtype.itemsize,
        )


@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)", "is ended by it: SIGSEGV"),
        (LISTED + "os.kill(os.getpid(), signal.SIGABRT)", "is ended by it: SIGABRT"),
        (LISTED + SENT + "print(end='1234567')", "is ended by it: exit code 0"),
        (LISTED + SENT.replace("[2]", "[3]"), "time is not what it is declared to be"),
        (LISTED + SENT.replace("<f8", "|O8"), "time is not what it is declared to be"),
        (LISTED + "print('what memory holds')", "damaged"),
        ("print('{}')", "damaged"),
        ("import sys\nsys.exit(3)", "is ended by it: exit code 3"),
        (
            LISTED + "resource.setrlimit(resource.RLIMIT_CPU, (1, 2))\nwhile True: pass",
            "does not come to an end",
        ),
    ],
    ids=["crash", "later", "cut", "shape", "objects", "garbage", "nothing", "code", "endless"],
)
def test_any_end_of_the_reading_process_is_reported(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str, message: str
) -> None:
    (tmp_path / "program.py").write_text(program)
    monkeypatch.setattr(datasets, "_PROGRAM", tmp_path / "program.py")
    with pytest.raises(InputError, match=message) as caught:
        read_raw(whole)
    assert "may be truncated or damaged" in str(caught.value)


def test_killed_reading_process_is_reported_as_lack_of_memory(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "program.py").write_text(LISTED + "os.kill(os.getpid(), signal.SIGKILL)")
    monkeypatch.setattr(datasets, "_PROGRAM", tmp_path / "program.py")
    with pytest.raises(OutOfMemoryError, match="more memory than is free"):
        read_raw(whole)


def test_interrupt_ends_both_processes(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = (
        "import os, time\nfrom pathlib import Path\nPath({!r}).write_text(str(os.getpid()))\ntime.sleep(60)"
    )
    (tmp_path / "program.py").write_text(program.format(str(tmp_path / "pid")))
    monkeypatch.setattr(datasets, "_PROGRAM", tmp_path / "program.py")
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            read_raw(whole)
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def answers(path: Path, asked: str) -> list[dict[str, object]]:
    done = subprocess.run(
        [sys.executable, program.__file__, str(path)], input=asked, capture_output=True, text=True
    )
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_reading_process_keeps_the_memory_limit(tmp_path: Path) -> None:
    """A file that asks for more is damaged; the machine lacks nothing."""
    with h5py.File(tmp_path / "a.mat", "w") as file:
        file.create_dataset("time", shape=(200_000_000,), dtype="f8")
    message = answers(tmp_path / "a.mat", '{"names": ["time"], "size": 1000}\n')
    assert message[0]["datasets"] == [{"name": "time", "shape": [200_000_000], "entry": 8, "chunk": 0}]
    assert "failed" in message[1]
    assert message[1]["memory"] is False


def test_cells_are_read_and_objects_are_reported(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        inner = file.create_dataset("#refs#/b", data=np.arange(60.0)[None])
        cells = file.create_dataset("log", (1, 1), dtype=h5py.ref_dtype)
        cells[0, 0] = inner.ref
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
        closed = file.create_dataset("out", data=np.arange(6, dtype="u4"))
        closed.attrs["MATLAB_class"] = np.bytes_("timeseries")
        closed.attrs["MATLAB_object_decode"] = np.int32(3)
    raw = read_raw(tmp_path / "a.mat")
    assert raw.names == ("log{1}",)
    np.testing.assert_array_equal(raw["log{1}"].ravel(), np.arange(60.0))
    with pytest.raises(InputError, match="out is an object of the class timeseries, which only MATLAB opens"):
        raw["out.Data"]
