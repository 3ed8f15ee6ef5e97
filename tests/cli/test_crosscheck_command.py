"""`missing-physics crosscheck`: what it writes, and that its numbers are those of the recordings."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
import typer
from rerun.chunk import RrdReader
from typer.testing import CliRunner

from missing_physics.cli.crosscheck import register
from missing_physics.reporting.crosscheck import differences
from robot_model import InputError, Recording, load_robot, save_robot


def run(*words: object) -> str:
    app = typer.Typer()
    app.command("idle")(lambda: None)  # with one command alone typer would drop its name
    register(app)
    result = CliRunner().invoke(app, ["crosscheck", *map(str, words)])
    if result.exception:
        raise result.exception
    return result.stdout


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """A file of the shipped two-link arm whose motion takes a fifth of a second."""
    arm = load_robot("two_link_arm")
    assert arm.reference is not None
    reference = arm.reference.model_copy(update={"duration": 0.2, "sample_rate": 100.0})
    save_robot(arm.model_copy(update={"reference": reference}), tmp_path / "arm.toml")
    return tmp_path / "arm.toml"


def test_both_engines_side_by_side(robot: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    table = run(robot, "--out", out)
    report = json.loads((out / "crosscheck.json").read_text())
    assert report["robot"] == "two_link_arm"
    assert {"joint1.position", "joint2.bending_moment", "robot.energy"} <= set(report["channels"])
    row = report["channels"]["joint1.position"]
    assert row["unit"] == "rad"
    assert 0 < row["rms"] <= row["max"] < 1e-6  # the engines agree to the error of Exudyn's step
    assert row["max_relative"] == pytest.approx(row["max"] / row["range"])
    assert "joint1.position" in table
    assert "only in reference: " in table  # temperatures
    paths = {str(chunk.entity_path).strip("/") for chunk in RrdReader(out / "comparison.rrd").stream()}
    for which in ("channels/{}/reference", "channels/{}/exudyn", "difference/{}"):
        assert which.format(rr.escape_entity_path_part("joint1.position")) in paths
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(out / "comparison.rrd")]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_json_to_stdout_is_the_file(robot: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    printed = run(robot, "--out", out, "--json", "--formulation", "tree")
    assert printed == (out / "crosscheck.json").read_text()
    assert json.loads(printed)["engines"]["exudyn"]["formulation"] == "tree"


def test_a_robot_that_an_engine_refuses_leaves_nothing_behind(tmp_path: Path) -> None:
    arm = load_robot("two_link_arm").model_copy(update={"reference": None})
    save_robot(arm, tmp_path / "arm.toml")
    with pytest.raises(InputError, match="reference"):
        run(tmp_path / "arm.toml", "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_numbers_of_a_difference() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0])
    first = Recording(time, {"a": np.array([0.0, 2.0, 4.0, 0.0]), "b": np.ones(4)}, "first")
    second = Recording(time, {"a": np.array([0.0, 2.0, 4.2, 0.1]), "b": np.ones(4) + 0.5}, "second")
    a, b = differences(first, second)
    assert (a.largest, a.time, a.extent) == (pytest.approx(0.2), 2.0, 4.0)
    assert a.rms == pytest.approx(np.sqrt((0.04 + 0.01) / 4))
    assert a.relative_largest == pytest.approx(0.05)
    assert b.largest == 0.5
    assert b.relative_largest is None  # a constant has no range
    with pytest.raises(InputError, match="different instants"):
        differences(first, Recording(time + 1, {"a": first["a"]}, "late"))
