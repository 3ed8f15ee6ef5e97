"""Contradicting channels at the command line: one sentence, a map to paste, and a way to continue."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from missing_physics.cli import UNUSABLE_INPUT, main
from missing_physics.recordings import load_recording, write_recording
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot, load_robot, save_robot


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


def test_diagnose_stops_and_prints_the_correcting_line_of_the_map(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("diagnose", folder / "robot.toml", folder / "wrong.csv", "--out", tmp_path / "out", "--quiet")
    assert run(monkeypatch, *words) == UNUSABLE_INPUT
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "wrong.csv: joint1.torque runs against the motion" in message
    assert '[channels."joint1.torque"] source = "joint1.torque", scale = -1' in message
    assert not (tmp_path / "out").exists()
    assert run(monkeypatch, *words, "--as-recorded") == 0
    assert (tmp_path / "out" / "diagnosis.json").is_file()


def test_inspect_prints_a_map_that_corrects_it(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("inspect", folder / "wrong.csv", "--robot", folder / "robot.toml")
    assert run(monkeypatch, *words) == UNUSABLE_INPUT
    printed = capsys.readouterr().out
    start = printed.index("Map that corrects it") + len("Map that corrects it")
    (tmp_path / "map.toml").write_text(printed[start : printed.index("It can tell")], "utf-8")
    assert run(monkeypatch, *words, "--map", tmp_path / "map.toml") == 0
    assert "runs against" not in capsys.readouterr().out


def test_without_a_robot_the_torque_is_not_checked(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "inspect", folder / "wrong.csv") == 0
    assert "Map that corrects it" not in capsys.readouterr().out


WRONG_RATES = {
    "a motor's velocity": (100.0, 0.0, "is the motor's own", "scale = 0.01"),
    "a velocity that is late": (1.0, 0.3, "lags behind the change of joint1.position", "delay = 0.3"),
    "an odd factor": (1.7, 0.0, "is 1.7 times the change of joint1.position", "scale = 0.588"),
}


@pytest.mark.parametrize("which", WRONG_RATES)
def test_diagnose_stops_and_reports_a_wrong_velocity(
    which: str,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    factor, lag, words, correction = WRONG_RATES[which]
    right = load_recording(folder / "wrong.csv")
    rate = np.gradient(right["joint1.position"], right.time)
    velocity = factor * np.interp(right.time - lag, right.time, rate)
    write_recording(right.with_channels({"joint1.velocity": velocity}), tmp_path / "wrong.csv")
    robot = load_robot(folder / "robot.toml")
    joint = robot.joints[0]
    assert joint.actuator is not None
    geared = joint.model_copy(update={"actuator": joint.actuator.model_copy(update={"gear_ratio": 100.0})})
    save_robot(robot.model_copy(update={"joints": (geared, *robot.joints[1:])}), tmp_path / "robot.toml")
    assert run(monkeypatch, "diagnose", tmp_path / "robot.toml", tmp_path / "wrong.csv") == UNUSABLE_INPUT
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert f"wrong.csv: joint1.velocity {words}" in message or f"of joint1.velocity {words}" in message
    assert correction in message


def test_diagnose_rejects_a_quaternion_in_another_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Dry friction is hidden besides: it is not named from a recording read wrongly."""
    robot = load_robot("six_joint_space_arm")
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": 12.0, "sample_rate": 100.0})
    robot = robot.model_copy(update={"reference": reference})
    hidden = EffectUse(effect="coulomb_friction", at=robot.moving_joints[0].name, torque=3.0)
    right = simulate(robot.with_effects(hidden), seed=10143)
    order = [f"base.attitude.{part}" for part in "wxyz"]
    assert {*order, "base.angular_velocity.x"} <= set(right)
    wrong = right.with_channels({c: right[source] for c, source in zip(order, (*order[1:], order[0]))})
    save_robot(robot, tmp_path / "robot.toml")
    write_recording(wrong, tmp_path / "wrong.csv")
    words = ("diagnose", tmp_path / "robot.toml", tmp_path / "wrong.csv", "--out", tmp_path / "out")
    assert run(monkeypatch, *words, "--quiet") == UNUSABLE_INPUT
    message = capsys.readouterr()
    assert message.err.count("\n") == 1
    assert "base.attitude is in the order x, y, z, w" in message.err
    for channel, source in zip(order, (order[3], *order[:3])):
        assert f'[channels."{channel}"] source = "{source}"' in message.err
    assert "friction" not in message.err + message.out
    assert not (tmp_path / "out").exists()
    write_recording(right, tmp_path / "right.csv")
    load_recording(tmp_path / "right.csv", robot=robot)  # as named, nothing contradicts
