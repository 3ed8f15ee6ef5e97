"""`inspect` and `diagnose` agree on the information in a recording."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from missing_physics.cli import main
from missing_physics.recordings import write_recording
from reference_model.evaluation.model import RobotModel
from robot_model import Recording, Robot, load_robot, save_robot

Channels = dict[str, np.ndarray]
Said = Callable[..., str]


def arm() -> Robot:
    robot = load_robot("two_link_arm")
    strong = []
    for joint in robot.joints:
        assert joint.actuator is not None
        actuator = joint.actuator.model_copy(update={"torque_limit": 300.0})
        strong.append(joint.model_copy(update={"actuator": actuator}))
    return robot.model_copy(update={"effects": (), "joints": tuple(strong)})


def made() -> Recording:
    """What the arm needs for a motion of sines, with the noise of its sensors."""
    time, chance = np.arange(2000) / 200.0, np.random.default_rng(1)
    rates = 2 * np.pi * np.array([[0.4, 0.7], [1.1, 1.3]])
    phase = rates * time[:, None, None]
    waves = np.sin(phase), rates * np.cos(phase), -(rates**2) * np.sin(phase)
    state = [wave.sum(axis=1) for wave in waves]
    torque = RobotModel(arm()).inverse_dynamics(*state)
    channels = {}
    for k, joint in enumerate(("joint1", "joint2")):
        channels[f"{joint}.position"] = state[0][:, k] + 5e-6 * chance.standard_normal(time.size)
        channels[f"{joint}.torque"] = torque[:, k] + 0.1 * chance.standard_normal(time.size)
    return Recording(time, channels)


def mute(channels: Mapping[str, np.ndarray]) -> Channels:
    return {name: y for name, y in channels.items() if "torque" not in name}


def named(quantity: str) -> Callable[[Mapping[str, np.ndarray]], Channels]:
    return lambda channels: {name.replace("torque", quantity): y for name, y in channels.items()}


def still(channels: Mapping[str, np.ndarray]) -> Channels:
    return {name: y - y * ("position" in name) for name, y in channels.items()}


def unplugged(channels: Mapping[str, np.ndarray]) -> Channels:
    return {name: y - y * ("torque" in name) for name, y in channels.items()}


def small(channels: Mapping[str, np.ndarray]) -> Channels:
    """Each joint moves once by 0.8 degrees, within a tenth of a second."""
    step = 0.007 * np.clip((np.arange(2000) / 200.0 - 5.0) / 0.05, -1.0, 1.0)
    held = RobotModel(arm()).inverse_dynamics(*np.zeros((3, 1, 2)))[0]
    noise = np.random.default_rng(2).normal(0.0, 0.1, 2000)
    return {
        name: np.round(step, 5) if "position" in name else held[int(name.startswith("joint2"))] + noise
        for name in channels
    }


def holed(channels: Mapping[str, np.ndarray]) -> Channels:
    lost = mute(channels)
    lost["joint1.position"] = lost["joint1.position"].copy()
    lost["joint1.position"][600:1400] = np.nan
    return lost


SPOILT = {
    "no torque": (mute, ["no torque, current or voltage is recorded"]),
    "no torque constant": (named("current"), ["add torque_constant [N m/A] to the joint's actuator"]),
    "no winding": (named("voltage"), ["add torque_constant [N m/A] and resistance [ohm]"]),
    "rest": (still, ["no motion beyond the noise of the position"]),
    "dead torque": (unplugged, ["joint1.torque is 0 throughout", "joint2.torque is 0 throughout"]),
    "hardly any motion": (small, ["joint1 and joint2: hardly any motion"]),
    "a hole": (holed, ["joint1.position has no number between 2.995 and 7 s", "no torque, current or"]),
}


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Said:
    def printed(*words: object) -> str:
        monkeypatch.setattr("sys.argv", ["missing-physics", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            main()
        message = capsys.readouterr()
        assert left.value.code == 0, message.err
        return message.out

    return printed


@pytest.mark.parametrize("kind", SPOILT)
def test_inspection_reports_what_a_diagnosis_cannot_diagnose(tmp_path: Path, run: Said, kind: str) -> None:
    spoil, reasons = SPOILT[kind]
    robot, log = tmp_path / "robot.toml", tmp_path / "log.npz"
    save_robot(arm(), robot)
    whole = made()
    write_recording(Recording(whole.time, spoil(whole.channels)), log)
    found = json.loads(run("diagnose", robot, log, "--out", tmp_path / "out", "--quiet", "--json"))
    seen = json.loads(run("inspect", log, "--robot", robot, "--json"))
    sentences = [finding["sentence"] for finding in seen["findings"]]
    assert found["verdict"] == "not_enough_data"
    for reason in reasons:
        [told] = [sentence for sentence in found["could_not_tell"] if reason in sentence]
        assert sentences.count(told) == 1
        assert told in found["summary"]
    assert set(found["could_not_tell"]) <= set(sentences)
    assert "a diagnosis with this robot ends as not_enough_data." in sentences
    assert not [line for line in seen["can_tell"] if line.startswith("joint")]


def test_inspection_and_diagnosis_agree_on_clean_recordings(tmp_path: Path, run: Said) -> None:
    save_robot(arm(), tmp_path / "robot.toml")
    write_recording(made(), tmp_path / "log.npz")
    out = run("inspect", tmp_path / "log.npz", "--robot", tmp_path / "robot.toml")
    assert "No problems found." in out
    assert " + joint1 and joint2: the force that resists the motion" in out
    told = run(
        "diagnose", tmp_path / "robot.toml", tmp_path / "log.npz", "--out", tmp_path / "out", "--quiet"
    )
    assert told.startswith("CONSISTENT")
    assert "On held-out data" not in told  # the first table has it all


def test_without_a_robot_a_missing_torque_is_a_problem_too(tmp_path: Path, run: Said) -> None:
    whole = made()
    write_recording(Recording(whole.time, mute(whole.channels)), tmp_path / "log.npz")
    out = run("inspect", tmp_path / "log.npz")
    assert "No problems found" not in out
    assert "joint1 and joint2: no torque, current or voltage is recorded" in out
    write_recording(Recording(whole.time, named("voltage")(whole.channels)), tmp_path / "log.npz")
    assert "must have the actuator's torque_constant and resistance" in run("inspect", tmp_path / "log.npz")


def test_missing_torque_constant_is_reported_once_on_the_console(tmp_path: Path, run: Said) -> None:
    save_robot(arm(), tmp_path / "robot.toml")
    whole = made()
    write_recording(Recording(whole.time, named("current")(whole.channels)), tmp_path / "log.npz")
    out = run("diagnose", tmp_path / "robot.toml", tmp_path / "log.npz", "--out", tmp_path / "out", "--quiet")
    assert " ".join(out.split()).count("torque_constant [N m/A]") == 1
    assert "neither recorded nor" not in out


@pytest.mark.parametrize(("count", "words"), [(0, "there is no reversal"), (1, "there is one reversal only")])
def test_few_reversals_are_reported(tmp_path: Path, run: Said, count: int, words: str) -> None:
    time = np.arange(1000) / 100.0
    there = time if count == 0 else np.abs(time - 4.0)
    write_recording(
        Recording(time, {"joint1.position": there, "joint1.torque": np.sin(time)}), tmp_path / "a.npz"
    )
    assert words in run("inspect", tmp_path / "a.npz")


def test_names_and_numbers_are_not_cut_on_a_narrow_terminal(
    tmp_path: Path, run: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    place = "front_left_upper_leg_with_a_long_name"
    time = np.arange(1000) / 100.0
    channels = {f"{place}.reference_position": np.sin(time), f"{place}.position": 0.123456 * np.sin(time)}
    write_recording(Recording(time, channels), tmp_path / "a.npz")
    out = run("inspect", tmp_path / "a.npz")
    table = [line.split() for line in out.splitlines()]
    assert [f"{place}.reference_position", "rad", "-1", "1"] in [row[:4] for row in table]
    assert [f"{place}.position", "rad", "-0.1235", "0.1235"] in [row[:4] for row in table]
    assert [place, "0.2469"] in [row[:2] for row in table]
    assert "\N{HORIZONTAL ELLIPSIS}" not in out
