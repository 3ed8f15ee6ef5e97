"""Premises of real machines: manual maps are right, and faults put into recordings are found."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from benchmarks.yardstick.loading import Loaded, load
from benchmarks.yardstick.machines import machine, rows
from missing_physics.api import inspect
from missing_physics.premises import premise_findings
from missing_physics.recordings import load_mapping, load_recording
from missing_physics.recordings.datasets import find_dataset
from robot_model import Recording, Robot

ROOT = Path(__file__).resolve().parents[2]


@cache
def loaded(name: str) -> Loaded:
    row = machine(name)
    if find_dataset(row.dataset) is None:
        pytest.skip(f"the recordings of {row.dataset} are not here; set MISSING_PHYSICS_DATA")
    return load(row.model_copy(update={"fit": row.fit[:1], "held_out": ()}))


def doubts(robot: Robot, recording: Recording) -> list[str]:
    return [finding.kind for finding in premise_findings(robot, recording) if finding.severity != "note"]


@pytest.mark.parametrize(
    "name", ["emps", "dfki_double_pendulum_C1", "dfki_simple_pendulum", "kinova_gen3", "go2"]
)
def test_manual_maps_violate_no_premise(name: str) -> None:
    found = loaded(name)
    assert doubts(found.robot, found.fit[0]) == []


@pytest.mark.proof
@pytest.mark.parametrize("name", [row.name for row in rows()])
def test_every_manual_map_violates_no_premise(name: str) -> None:
    row = machine(name)
    if find_dataset(row.dataset) is None:
        pytest.skip(f"the recordings of {row.dataset} are not here; set MISSING_PHYSICS_DATA")
    whole = load(row)
    for recording in (*whole.fit, *whole.held_out):
        assert doubts(whole.robot, recording) == [], recording.source


@pytest.mark.parametrize("name", ["dfki_double_pendulum_C1", "dfki_simple_pendulum", "kinova_gen3", "go2"])
def test_gravity_removed_from_a_robot_file_is_found(name: str) -> None:
    found = loaded(name)
    floating = found.robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    assert doubts(floating, found.fit[0]) == ["no_gravity"]


@pytest.mark.parametrize("name", ["dfki_double_pendulum_C1", "dfki_simple_pendulum", "cycloidal_pendulum"])
def test_motor_side_torques_are_found(name: str) -> None:
    found = loaded(name)
    ratios = {j.name: j.actuator.gear_ratio for j in found.robot.moving_joints if j.actuator is not None}
    recording = found.fit[0]
    wrong = {f"{name}.torque": recording[f"{name}.torque"] / ratio for name, ratio in ratios.items()}
    assert doubts(found.robot, recording.with_channels(wrong)) == ["motor_side"]


def test_torque_computed_by_the_firmware_is_found() -> None:
    """The column `Torque` of the Gen3's logs is its authors' model; its name says nothing of that."""
    found = loaded("kinova_gen3")
    folder = find_dataset("kinova_gen3")
    assert folder is not None
    mapping = load_mapping(ROOT / "examples" / "kinova_gen3" / "map.toml")
    channels = {
        name: source.model_copy(update={"source": (source.source or "").replace("TorqueCur", "Torque")})
        for name, source in mapping.channels.items()
    }
    path = next(folder.rglob("opti_traj_testing1.csv"))
    recording = load_recording(path, mapping=mapping.model_copy(update={"channels": channels}), check=False)
    assert "computed_torque" in doubts(found.robot, recording)


def test_commanded_torque_in_a_map_is_reported() -> None:
    folder = find_dataset("dfki_double_pendulum")
    if folder is None:
        pytest.skip("the recordings of dfki_double_pendulum are not here; set MISSING_PHYSICS_DATA")
    path = next(folder.rglob("C1_sysid_143524.csv"))
    for name, kinds in (("map.toml", []), ("map_command.toml", ["command"])):
        found = inspect(path, map=ROOT / "examples" / "dfki_double_pendulum" / name)
        assert [problem.kind for problem in found.problems if problem.kind == "command"] == kinds
