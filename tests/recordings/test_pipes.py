"""Pipes and names in /dev are read like files."""

from __future__ import annotations

import io
import json
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from missing_physics.cli import main
from missing_physics.recordings import load_recording, load_recording_and_constants, mapping_from_toml
from robot_model import InputError

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no pipes with names")

TIME = np.arange(80) / 100.0
POSITION = np.sin(3 * TIME)
COLUMNS = {"time": TIME, "joint1.position": POSITION}
TEXT = "time,joint1.position\n" + "\n".join(f"{t!r},{q!r}" for t, q in zip(TIME.tolist(), POSITION.tolist()))


@contextmanager
def through(pipe: Path, content: bytes) -> Iterator[Path]:
    """A pipe into which another thread writes once."""
    os.mkfifo(pipe)

    def write() -> None:
        try:
            with pipe.open("wb") as file:
                file.write(content)
        except BrokenPipeError:  # the reader has had enough
            pass

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    yield pipe
    writer.join(timeout=10)
    assert not writer.is_alive()


def bytes_of(write: Callable[[io.BytesIO], object]) -> bytes:
    stream = io.BytesIO()
    write(stream)
    return stream.getvalue()


CONTENTS = {
    "csv": TEXT.encode(),
    "json": json.dumps(
        [dict(zip(COLUMNS, row)) for row in zip(*(c.tolist() for c in COLUMNS.values()))]
    ).encode(),
    "npz": bytes_of(lambda stream: np.savez(stream, **COLUMNS)),
    "parquet": bytes_of(lambda stream: pq.write_table(pa.table(COLUMNS), stream)),
    "mat": bytes_of(
        lambda stream: scipy.io.savemat(stream, {"time": TIME, "joint1": {"position": POSITION}})
    ),
}


@pytest.mark.parametrize("suffix", CONTENTS)
def test_every_format_is_read_from_a_pipe(tmp_path: Path, suffix: str) -> None:
    with through(tmp_path / f"pipe.{suffix}", CONTENTS[suffix]) as pipe:
        recording = load_recording(pipe)
    np.testing.assert_array_equal(recording.time, TIME)
    np.testing.assert_array_equal(recording["joint1.position"], POSITION)
    assert recording.source == str(pipe)


def test_pipe_without_a_suffix_is_read_as_csv(tmp_path: Path) -> None:
    with through(tmp_path / "pipe", CONTENTS["csv"]) as pipe:
        np.testing.assert_array_equal(load_recording(pipe)["joint1.position"], POSITION)


def test_pipe_is_read_once_for_channels_and_constants(tmp_path: Path) -> None:
    text = """
        [time]
        source = "time"
        [channels."joint1.position"]
        source = "joint1.position"
        [constants]
        gain = "kp"
    """
    content = bytes_of(lambda stream: np.savez(stream, kp=7.0, **COLUMNS))
    with through(tmp_path / "pipe.npz", content) as pipe:
        recording, constants = load_recording_and_constants(pipe, mapping=mapping_from_toml(text))
    assert (len(recording), constants) == (80, {"gain": 7.0})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "pipe is empty"),
        (b"PK\0\1", "pipe holds binary data, not text"),
        (TEXT.encode()[:-300] + b"\n1,2,3", "pipe has 3 cells in row"),
        (b"0," * 600_000, "more than 0.001 GB come through"),
    ],
)
def test_error_messages_name_the_pipe_and_no_copy_remains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes, message: str
) -> None:
    (tmp_path / "copies").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "copies"))
    with through(tmp_path / "pipe", content) as pipe, pytest.raises(InputError) as error:
        load_recording(pipe, size_limit=1e6)
    assert f"{tmp_path}/" in str(error.value)
    assert message in str(error.value)
    assert "piped" not in str(error.value)
    assert not list((tmp_path / "copies").iterdir())


def test_map_is_read_from_a_pipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text(TEXT.replace("joint1.position", "q"))
    text = b'[time]\nsource = "time"\n[channels."joint1.position"]\nsource = "q"\n'
    with through(tmp_path / "map", text) as pipe:
        monkeypatch.setattr(
            "sys.argv", ["x", "inspect", str(tmp_path / "a.csv"), "--map", str(pipe), "--json"]
        )
        with pytest.raises(SystemExit) as end:
            main()
    assert end.value.code == 0
    assert json.loads(capsys.readouterr().out)["samples"] == 80


@pytest.mark.skipif(not Path("/dev/stdin").exists(), reason="the system has no /dev/stdin")
@pytest.mark.parametrize("redirected", [True, False])
def test_standard_input(tmp_path: Path, redirected: bool) -> None:
    """From a file, or from a pipe."""
    (tmp_path / "a.csv").write_text(TEXT)
    reading, writing = os.pipe()
    os.write(writing, TEXT.encode())
    os.close(writing)
    before = os.dup(0)
    try:
        with (tmp_path / "a.csv").open() as file:
            os.dup2(file.fileno() if redirected else reading, 0)
            assert len(load_recording("/dev/stdin")) == 80
    finally:
        os.dup2(before, 0)
        for descriptor in (before, reading):
            os.close(descriptor)
