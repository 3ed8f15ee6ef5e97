"""Contradicting channels at the command line: one sentence, a map to paste, and a way to go on."""

from __future__ import annotations

from pathlib import Path

import pytest

from missing_physics.cli import UNUSABLE_INPUT, main
from missing_physics.recordings import write_recording
from reference_model.simulation import simulate
from robot_model import Robot, load_robot, save_robot


def run(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr("sys.argv", ["missing-physics", *map(str, words)])
    with pytest.raises(SystemExit) as left:
        main()
    return int(left.value.code or 0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The single axis, its torque reversed and its file without a map."""
    where = tmp_path_factory.mktemp("reversed")
    robot: Robot = load_robot("single_axis")
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": 10.0, "sample_rate": 250.0})
    robot = robot.model_copy(update={"reference": reference})
    recording = simulate(robot, seed=10142)
    wrong = recording.with_channels({"joint1.torque": -recording["joint1.torque"]})
    save_robot(robot, where / "robot.toml")
    write_recording(wrong, where / "wrong.csv")
    return where


def test_diagnose_ends_with_the_line_of_the_map(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("diagnose", folder / "robot.toml", folder / "wrong.csv", "--out", tmp_path / "out", "--quiet")
    assert run(monkeypatch, *words) == UNUSABLE_INPUT
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "wrong.csv: joint1.torque runs against the motion" in said
    assert '[channels."joint1.torque"] source = "joint1.torque", scale = -1' in said
    assert not (tmp_path / "out").exists()
    assert run(monkeypatch, *words, "--as-recorded") == 0
    assert (tmp_path / "out" / "diagnosis.json").is_file()


def test_inspect_prints_a_map_that_mends_it(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("inspect", folder / "wrong.csv", "--robot", folder / "robot.toml")
    assert run(monkeypatch, *words) == UNUSABLE_INPUT
    printed = capsys.readouterr().out
    start = printed.index("Map that mends it") + len("Map that mends it")
    (tmp_path / "map.toml").write_text(printed[start : printed.index("It can tell")], "utf-8")
    assert run(monkeypatch, *words, "--map", tmp_path / "map.toml") == 0
    assert "runs against" not in capsys.readouterr().out


def test_without_a_robot_the_torque_cannot_be_judged(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "inspect", folder / "wrong.csv") == 0
    assert "Map that mends it" not in capsys.readouterr().out
