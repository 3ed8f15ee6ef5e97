"""Each kind of unusable input: one sentence with file and correction, exit code 2, no debris."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from missing_physics.recordings import load_recording, write_recording
from robot_model import InputError, Recording

T = np.arange(100) / 100.0
Q = np.sin(T)


def csv(path: Path, rows: list[str], header: str = "time,joint1.position") -> None:
    path.write_text("\n".join([header, *rows]) + "\n")


def rows_with(index: int, row: str) -> list[str]:
    rows = [f"{t},{q}" for t, q in zip(T, Q)]
    rows[index] = row
    return rows


CASES: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "missing": ("a.csv", lambda p: None, "does not exist; give the path"),
    "folder": ("a.csv", lambda p: p.mkdir(), "is a folder, not a recording"),
    "empty": ("a.parquet", lambda p: p.write_bytes(b""), "is empty; record or export it again"),
    "suffix": ("a.xlsx", lambda p: p.write_bytes(b"x"), "suffix '.xlsx', which no reader knows"),
    "unread suffix": ("a.xyz", lambda p: p.write_bytes(b"x"), "); export it to one of these."),
    "near suffix": ("a.jsn", lambda p: p.write_bytes(b"x"), "did you mean '.json'?"),
    "header only": ("a.csv", lambda p: csv(p, []), "header but no rows"),
    "truncated row": (
        "a.csv",
        lambda p: csv(p, rows_with(99, "0.99")),
        "1 cells in row 101 where 2 are expected",
    ),
    "truncated file": (
        "a.npz",
        lambda p: (np.savez(p, time=T, **{"joint1.position": Q}), p.write_bytes(p.read_bytes()[:700])),
        "truncated or damaged",
    ),
    "binary as text": ("a.csv", lambda p: p.write_bytes(b"time,\0\1\2"), "holds binary data, not text"),
    "all NaN": ("a.csv", lambda p: csv(p, [f"{t}," for t in T]), "no number at all for joint1.position"),
    "infinite": (
        "a.csv",
        lambda p: csv(p, rows_with(10, "0.1,inf")),
        "infinite value of joint1.position in row 12",
    ),
    "out of all proportion": (
        "a.csv",
        lambda p: csv(p, rows_with(10, "0.1,-3e200")),
        "has -3e+200 for joint1.position in row 12, which no machine reaches",
    ),
    "counts for radians": (
        "a.csv",
        lambda p: csv(p, rows_with(10, "0.1,9.2e18")),
        "has 9.2e+18 for joint1.position in row 12, which no machine reaches; correct it or its unit",
    ),
    "stray instant": (
        "a.csv",
        lambda p: csv(p, rows_with(50, "0.2,0")),
        "row 52 has the time 0.2 s where the rows next to it have 0.49 s and 0.51 s, so it is damaged",
    ),
    "stray instant ahead": (
        "a.csv",
        lambda p: csv(p, rows_with(50, "8e5,0")),
        "row 52 has the time 800000.0 s where the rows next to it have 0.49 s and 0.51 s, so it is damaged",
    ),
    "stray instant between records": (
        "a.csv",
        lambda p: csv(p, [*rows_with(0, "0,0"), "0,0", *(f"{1 + t},0" for t in T)]),
        "row 102 has the time 0.0 s where the rows next to it have 0.99 s and 1.0 s, so it is damaged or not "
        "a sample; remove it.",
    ),
    "unwritten end": (
        "a.csv",
        lambda p: csv(p, [*rows_with(0, "0,0"), *["0,0"] * 60]),
        "row 102 has the time 0.0 s where the rows next to it have 0.99 s (60 such rows), so it is damaged "
        "or not a sample; remove these rows.",
    ),
    "unsorted": (
        "a.csv",
        lambda p: csv(p, [f"{T[k ^ 1]},0" for k in range(len(T))]),
        "time goes back in row 3 (0.01 s, then 0.0 s; 50 such rows); the rows are out of order: sort them",
    ),
    "rows written late": (
        "a.csv",
        lambda p: csv(p, [f"{t},0" for k, t in enumerate(T) if k not in (20, 30)] + ["0.2,0", "0.3,0"]),
        "the rows are out of order: sort them by time.",
    ),
    "text for an instant": (
        "a.csv",
        lambda p: csv(p, rows_with(50, "%&$,0")),
        "has '%&$' where a number is expected, in column 'time', row 52; correct it or remove the row.",
    ),
    "repeated": ("a.csv", lambda p: csv(p, rows_with(50, "0.49,0")), "time repeats in row 52"),
    "repeated since 1970": (
        "a.csv",
        lambda p: csv(p, [f"{1.7e9 + (t if k != 50 else 0.49)},0" for k, t in enumerate(T)]),
        "time repeats in row 52 (1700000000.49 s, then",
    ),
    "time missing": ("a.csv", lambda p: csv(p, rows_with(50, ",0")), "no number for time in row 52"),
    "short": ("a.csv", lambda p: csv(p, rows_with(0, "0,0")[:49]), "49 samples; at least 50 are needed"),
    "text": (
        "a.csv",
        lambda p: csv(p, rows_with(3, "0.03,n/m")),
        "'n/m' where a number is expected, in column",
    ),
    "two columns": ("a.csv", lambda p: csv(p, ["0,1,2"], "time,a.position,a.position"), "two columns called"),
    "no time": (
        "a.csv",
        lambda p: csv(p, rows_with(0, "0,0"), "t,joint1.position"),
        "has no variable 'time'",
    ),
    "no channel": ("a.csv", lambda p: csv(p, rows_with(0, "0,0"), "time,q"), "no native channel except time"),
    "misspelt": ("a.csv", lambda p: csv(p, rows_with(0, "0,0"), "time,joint1.postion"), "did you mean"),
    "lengths": (
        "a.npz",
        lambda p: np.savez(p, time=T, **{"joint1.position": Q[:80]}),
        "80 samples for joint1.position but 100 for time",
    ),
    "milliseconds": (
        "a.npz",
        lambda p: np.savez(p, time=1000 * T, **{"joint1.position": Q}),
        "if it is in milliseconds, give scale = 0.001",
    ),
    "denormal time steps": (
        "a.npz",
        lambda p: np.savez(p, time=1e-320 * np.arange(100), **{"joint1.position": Q}),
        "time rises by 1e-320 s to row 2, less than any recorder's step; correct the unit of time",
    ),
    "one denormal time step": (
        "a.csv",
        lambda p: csv(p, ["0,0", "1e-320,0", *rows_with(0, "0,0")[1:]]),
        "time rises by 1e-320 s to row 3, less",
    ),
    "time beyond all clocks": (
        "a.npz",
        lambda p: np.savez(p, time=1e29 * np.arange(100), **{"joint1.position": Q}),
        "has the time 1.1e+30 s in row 12, which no clock shows",
    ),
    "celsius": (
        "a.npz",
        lambda p: np.savez(p, time=T, **{"joint1.temperature": 30 + T}),
        "in degrees Celsius; add 273.15",
    ),
    "single value": ("a.json", lambda p: p.write_text("3"), "a list of samples is expected"),
    "deep": ("a.json", lambda p: p.write_text("[" * 100_000), "cannot be read as JSON"),
    "huge integer": (
        "a.json",
        lambda p: p.write_text(str([{"time": 1, "joint1.position": 10**400}] * 2).replace("'", '"')),
        "where a number is expected",
    ),
}


def command(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """Exit code of the command line, as a shell would see it."""
    from missing_physics.cli import main

    monkeypatch.setattr(sys, "argv", ["missing-physics", *arguments])
    with pytest.raises(SystemExit) as left:
        main()
    return int(left.value.code or 0)


@pytest.mark.parametrize("name", CASES)
def test_unusable_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    file, make, sentence = CASES[name]
    path = tmp_path / file
    make(path)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError) as caught:
        load_recording(path)
    assert sentence in str(caught.value)
    assert file in str(caught.value)
    assert command(monkeypatch, "inspect", str(path)) == 2
    shown = capsys.readouterr().err
    assert shown.startswith("missing-physics: ")
    assert shown.count("\n") == 1
    assert sentence in shown
    assert sorted(tmp_path.rglob("*")) == before


def test_absent_channel(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", time=T, **{"joint1.position": Q})
    with pytest.raises(InputError, match=r"no channel 'joint1\.torque'"):
        load_recording(tmp_path / "a.npz")["joint1.torque"]


def test_unknown_key_in_a_mapping_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    np.savez(tmp_path / "a.npz", q=Q)
    (tmp_path / "m.toml").write_text(
        '[time]\nrate = 100\n[channels."joint1.position"]\nsource = "q"\nscal = 2\n'
    )
    code = command(monkeypatch, "inspect", str(tmp_path / "a.npz"), "--map", str(tmp_path / "m.toml"))
    assert code == 2
    assert "unknown key" in (shown := capsys.readouterr().err)
    assert "did you mean 'scale'?" in shown


def test_failed_write_keeps_the_old_file(
    tmp_path: Path, swing: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.npz"
    write_recording(swing, path)
    before = path.read_bytes()

    def fail(file: Path, **arrays: object) -> None:
        Path(file).write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", fail)
    with pytest.raises(OSError, match="disk full"):
        write_recording(swing, path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_inspect_shows_the_report_before_it_refuses(
    tmp_path: Path, swing: Recording, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = swing.with_channels({"joint1.position": 180 / np.pi * swing["joint1.position"]})
    write_recording(wrong, tmp_path / "a.parquet")
    assert command(monkeypatch, "inspect", str(tmp_path / "a.parquet")) == 2
    out, err = capsys.readouterr()
    assert "joint1.velocity" in out
    assert "It can tell" in out
    assert "in degrees" in err


def test_inspect_reports_problems_that_stop_a_diagnosis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    csv(tmp_path / "a.csv", rows_with(0, "0,0"), "time,joint9.position")
    assert command(monkeypatch, "inspect", str(tmp_path / "a.csv"), "--robot", "single_axis") == 0
    message = " ".join(capsys.readouterr().out.split())
    assert "a diagnosis with this robot stops" in message
    assert "joint1.position" in message


@pytest.mark.parametrize("quiet", [False, True])
def test_inspect_json(
    tmp_path: Path,
    swing: Recording,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    quiet: bool,
) -> None:
    import json

    coarse = swing.with_channels({"joint1.position": np.round(swing["joint1.position"], 3)})
    write_recording(coarse, tmp_path / "a.csv")
    options = ["--json", "--quiet"] if quiet else ["--json"]
    assert command(monkeypatch, "inspect", str(tmp_path / "a.csv"), *options) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["samples"] == 1000
    assert [c["name"] for c in content["channels"]] == list(swing)
    assert content["channels"][0]["resolution"] == pytest.approx(1e-3)
    assert content["motion"][0]["place"] == "joint1"
    assert {f["severity"] for f in content["findings"]} == (set() if quiet else {"note"})
