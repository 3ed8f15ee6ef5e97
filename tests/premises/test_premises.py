"""Premises of a diagnosis: faults are found, and clean recordings give no message."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from missing_physics.cli import UNUSABLE_INPUT, main
from missing_physics.premises import premise_findings
from missing_physics.recordings import Finding, write_recording
from reference_model.evaluation.model import RobotModel
from robot_model import Recording, Robot, load_robot, save_robot

CONSTANT = 0.05
KINDS = ("no_gravity", "motor_side", "current", "no_weight", "computed_torque", "command")


@cache
def arm() -> Robot:
    """Two links that gravity pulls, gears of some 80 and a torque constant."""
    robot = load_robot("two_link_arm")
    joints = []
    for joint in robot.joints:
        assert joint.actuator is not None
        motor = joint.actuator.model_copy(update={"torque_constant": CONSTANT})
        joints.append(joint.model_copy(update={"actuator": motor}))
    return robot.model_copy(update={"effects": (), "joints": tuple(joints)})


@cache
def recorded(friction: float = 6.0, noise: float = 0.3, samples: int = 4000) -> Recording:
    """The arm along sums of sines, with friction [N m] and noise of its torques [N m]."""
    time, chance = np.arange(samples) / 200.0, np.random.default_rng(3)
    rates = 2 * np.pi * np.array([[0.11, 0.27], [0.17, 0.41]])
    phase = rates * time[:, None, None] + np.array([[0.3, 1.1], [2.0, 0.7]])
    position, velocity, acceleration = (
        wave.sum(axis=1) for wave in (np.sin(phase), rates * np.cos(phase), -(rates**2) * np.sin(phase))
    )
    torque = 1.2 * RobotModel(arm()).inverse_dynamics(position, velocity, acceleration)
    torque = torque + friction * np.tanh(velocity / 0.02) + noise * chance.standard_normal(torque.shape)
    channels = {}
    for k, joint in enumerate(("joint1", "joint2")):
        channels[f"{joint}.position"] = position[:, k] + 1e-5 * chance.standard_normal(samples)
        channels[f"{joint}.torque"] = torque[:, k]
    return Recording(time, channels, source="run")


def torques(recording: Recording, change: Callable[[str, np.ndarray], np.ndarray]) -> Recording:
    return recording.with_channels({c: change(c, recording[c]) for c in recording if c.endswith(".torque")})


def ratio(robot: Robot, channel: str) -> float:
    actuator = robot.joint(channel.split(".")[0]).actuator
    assert actuator is not None
    return actuator.gear_ratio


def seen(robot: Robot, recording: Recording) -> dict[str, Finding]:
    return {finding.kind: finding for finding in premise_findings(robot, recording)}


def weightless(robot: Robot) -> Robot:
    return robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)})


def test_clean_recording_violates_no_premise() -> None:
    assert seen(arm(), recorded()) == {}


def test_arm_without_gravity_torques_violates_no_premise() -> None:
    """Its torques hold none, and its file has none."""
    still, moved = recorded(), RobotModel(weightless(arm()))
    position, velocity = (
        np.stack(
            [np.gradient(still[f"{j}.position"], 0.005) if rate else still[f"{j}.position"] for j in J], 1
        )
        for rate in (False, True)
    )
    smooth = np.stack([np.convolve(v, np.ones(21) / 21, "same") for v in velocity.T], 1)
    torque = moved.inverse_dynamics(position, smooth, np.gradient(smooth, 0.005, axis=0))
    torque += 6.0 * np.tanh(smooth / 0.02)
    recording = still.with_channels({f"{j}.torque": torque[:, k] for k, j in enumerate(J)})
    assert seen(weightless(arm()), recording) == {}
    assert set(seen(arm(), recording)) == {"no_weight"}


J = ("joint1", "joint2")


def test_missing_gravity_is_found_with_its_axis() -> None:
    finding = seen(weightless(arm()), recorded())["no_gravity"]
    assert finding.severity == "error"
    assert finding.sentence.startswith("no gravity given; -9.81 along z would explain ")
    assert "gravity = [0.0, 0.0, -9.81]" in finding.sentence
    assert finding.numbers["share"] > 0.8


@pytest.mark.parametrize("kind", ["motor_side", "current"])
def test_a_torque_of_the_motor_is_distinguished_from_its_current(kind: str) -> None:
    """Gears of some 80 alone, or times a constant of 0.05 N m/A: some 4 N m per A."""
    robot = arm()
    factor = CONSTANT if kind == "current" else 1.0
    wrong = torques(recorded(), lambda channel, torque: torque / (factor * ratio(robot, channel)))
    finding = seen(robot, wrong)[kind]
    assert finding.numbers["probability"] > 0.5
    corrections = {correction.channel: correction.scale for correction in finding.corrections}
    assert corrections == {c: pytest.approx(factor * ratio(robot, c)) for c in wrong if c.endswith(".torque")}


def test_single_motor_side_torque_is_found_among_joint_torques() -> None:
    robot = arm()
    wrong = torques(
        recorded(), lambda c, torque: torque / (ratio(robot, c) if c.startswith("joint2") else 1.0)
    )
    assert [correction.channel for correction in seen(robot, wrong)["motor_side"].corrections] == [
        "joint2.torque"
    ]


def test_torque_without_friction_and_noise_is_recognised_as_computed() -> None:
    assert set(seen(arm(), recorded(friction=0.0, noise=0.0))) == {"computed_torque"}
    assert "computed_torque" not in seen(arm(), recorded(friction=1.0, noise=0.0))


@pytest.mark.parametrize(("noise", "kinds"), [(0.0, {"command"}), (0.05, set())])
def test_a_command_is_distinguished_from_a_torque_that_follows_it(noise: float, kinds: set[str]) -> None:
    """A PD law of what is recorded, to its rounding; with noise of its own it was measured."""
    recording, chance = recorded(), np.random.default_rng(5)
    channels: dict[str, np.ndarray] = {}
    for joint in J:
        position = recording[f"{joint}.position"]
        reference = position + 1e-2 * np.sin(3.0 * recording.time + 1.0) ** 3
        law = 900.0 * (reference - position) - 40.0 * np.gradient(position, recording.time)
        channels[f"{joint}.reference_position"] = reference
        channels[f"{joint}.torque"] = np.round(law, 6) + noise * chance.standard_normal(law.size)
    found = seen(weightless(arm()), recording.with_channels(channels))
    assert {kind for kind in found if kind == "command"} == kinds


def test_command_line_stops_with_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    save_robot(weightless(arm()), tmp_path / "arm.toml")
    write_recording(recorded(), tmp_path / "run.csv")
    for words in (
        ["diagnose", "arm.toml", "run.csv", "--quiet"],
        ["inspect", "run.csv", "--robot", "arm.toml"],
    ):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr("sys.argv", ["missing-physics", *words])
        with pytest.raises(SystemExit) as left:
            main()
        assert left.value.code == UNUSABLE_INPUT
        message = capsys.readouterr().err
        assert message.count("\n") == 1
        assert "run.csv: no gravity given; -9.81 along z would explain" in message
