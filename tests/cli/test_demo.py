"""The demo: what it hides, what it shows, and that it does not tell before the end."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from typer import Typer
from typer.testing import CliRunner

from exudyn_model.motion import motions
from missing_physics.cli import demo as module
from robot_model import EffectUse, Robot, load_robot

SEEDS = range(60)


@pytest.fixture
def arm() -> Robot:
    """The demo's robot, with one second of motion instead of twenty."""
    robot = load_robot(module.ROBOT)
    assert robot.reference is not None
    return robot.model_copy(update={"reference": robot.reference.model_copy(update={"duration": 1.0})})


def test_every_effect_and_joint_comes_up_and_stays_in_its_ranges(arm: Robot) -> None:
    drawn = [module.hidden_effect(arm, seed=seed) for seed in SEEDS]
    assert {use.effect for use in drawn} == set(module.HIDEABLE)
    assert {use.at for use in drawn} == {"joint1", "joint2"}
    for use in drawn:
        actuator = arm.joint(use.at).actuator
        assert actuator is not None
        assert actuator.torque_limit is not None
        hideable = module.HIDEABLE[use.effect]
        for name, (lower, upper) in hideable.ranges.items():
            scale = actuator.torque_limit / 100.0 if name in hideable.torques else 1.0
            # Drawn values are rounded to three digits.
            assert 0.99 * lower * scale <= abs(use.parameters[name]) <= 1.01 * upper * scale
            assert name in hideable.signed or use.parameters[name] > 0


def test_a_seed_always_hides_the_same(arm: Robot) -> None:
    assert module.hidden_effect(arm, seed=5) == module.hidden_effect(arm, seed=5)


def test_the_validation_motion_is_another_one_within_the_limits() -> None:
    robot = load_robot(module.ROBOT)
    assert robot.reference is not None
    time = np.arange(0, robot.reference.duration, 0.01)
    for seed in range(10):
        other = module.validation_motion(robot.reference, seed=seed)
        moved = robot.model_copy(update={"reference": other})
        for joint, first, second in zip(robot.moving_joints, motions(robot), motions(moved)):
            there = np.array([second(t) for t in time])
            assert np.corrcoef([first(t)[0] for t in time], there[:, 0])[0, 1] < 0.9
            assert joint.velocity_limit is not None
            assert np.abs(there[:, 1]).max() < joint.velocity_limit


FOUND = {
    "effect": "coulomb_friction",
    "location": "joint1",
    "parameters": {"torque": {"value": 4.0, "ci95": [3.9, 4.1], "unit": "N m"}},
}


def test_the_truth_is_in_no_file_while_the_diagnosis_runs(
    tmp_path: Path, arm: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "load_robot", lambda name: arm)
    seen: list[list[str]] = []

    def diagnose(command: list[str], *, check: bool) -> subprocess.CompletedProcess[bytes]:
        truth = module.hidden_effect(arm, seed=7)
        for path in (path for path in tmp_path.rglob("*") if path.is_file()):
            text = path.read_text("utf-8")
            assert truth.effect not in text
        columns = (tmp_path / "case" / "recording.csv").read_text("utf-8").splitlines()[0]
        measured = {sensor.channel for sensor in arm.sensors}
        references = {f"{joint.name}.reference_position" for joint in arm.joints}
        assert set(columns.replace('"', "").split(",")) == {"time", *measured, *references}
        seen.append(command)
        (tmp_path / "diagnosis.json").write_text(json.dumps({"findings": [FOUND]}))
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(subprocess, "run", diagnose)
    app = Typer()
    module.register(app)
    result = CliRunner().invoke(app, ["--out", str(tmp_path), "--seed", "7"])
    assert result.exit_code == 0, result.output
    [command] = seen
    assert command[1:4] == ["-m", "missing_physics", "diagnose"]
    assert command[command.index("--validate") + 1] == str(tmp_path / "case" / "validation.csv")
    assert module.hidden_effect(arm, seed=7).effect in result.output
    assert load_robot(tmp_path / "case" / "robot.toml") == arm


def test_a_failing_diagnosis_ends_the_demo_with_its_code(
    tmp_path: Path, arm: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "load_robot", lambda name: arm)
    monkeypatch.setattr(subprocess, "run", lambda command, check: subprocess.CompletedProcess(command, 2))
    app = Typer()
    module.register(app)
    assert CliRunner().invoke(app, ["--out", str(tmp_path)]).exit_code == 2


def revealed(truth: dict[str, Any], findings: list[dict[str, Any]]) -> str:
    console = Console(record=True, width=80)
    module.reveal(EffectUse.model_validate(truth), findings, console)
    return console.export_text()


def test_the_reveal_sets_truth_beside_finding() -> None:
    text = revealed({"effect": "coulomb_friction", "at": "joint1", "torque": 4.05}, [FOUND])
    rows = {line.split()[0]: line.split() for line in text.splitlines() if line.strip()}
    assert "hidden: coulomb_friction at joint1" in text
    assert "found:  coulomb_friction at joint1 (effect: yes, place: yes)" in text
    assert rows["torque"] == ["torque", "[N", "m]", "4.05", "4", "3.9", "to", "4.1", "yes"]


def test_the_reveal_does_not_hide_a_failure() -> None:
    truth = {"effect": "cable_spring", "at": "joint2", "stiffness": 3.0}
    text = revealed(truth, [FOUND, {**FOUND, "effect": "torque_offset", "location": "joint2"}])
    rows = {line.split()[0]: line.split() for line in text.splitlines() if line.strip()}
    assert "found:  torque_offset at joint2 (effect: no, place: yes)" in text
    assert rows["stiffness"][:3] == ["stiffness", "3", "-"]
    assert "also found: coulomb_friction at joint1" in text
    assert "found:  nothing" in revealed(truth, [])
