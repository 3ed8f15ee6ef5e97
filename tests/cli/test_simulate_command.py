"""`missing-physics simulate`: output and rejected input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from missing_physics.cli.commands.simulate import register
from missing_physics.recordings import load_recording
from reference_model.simulation import simulate
from robot_model import InputError, Robot, load_robot, save_robot


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """A file of the shipped two-link arm whose motion takes half a second."""
    arm = load_robot("two_link_arm")
    assert arm.reference is not None
    short = arm.model_copy(update={"reference": arm.reference.model_copy(update={"duration": 0.5})})
    save_robot(short, tmp_path / "arm.toml")
    return tmp_path / "arm.toml"


def run(*words: object) -> None:
    app = typer.Typer()
    app.command("idle")(lambda: None)  # with one command alone typer would drop its name
    register(app)
    result = CliRunner().invoke(app, ["simulate", *map(str, words)])
    if result.exception:
        raise result.exception


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_simulate_command_writes_the_simulated_recording(robot: Path, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"run.{suffix}"
    run(robot, "--out", out, "--seed", 7)
    wanted, found = simulate(load_robot(robot), seed=7), load_recording(out)
    assert set(found) == set(wanted)
    for name in wanted:
        np.testing.assert_array_equal(found[name], wanted[name])


def test_truth_option_writes_every_channel(robot: Path, tmp_path: Path) -> None:
    run(robot, "--out", tmp_path / "run.csv", "--truth")
    assert "joint2.radial_force" in load_recording(tmp_path / "run.csv")


def test_simulate_command_gives_the_same_motion_with_both_engines(robot: Path, tmp_path: Path) -> None:
    for engine in ("reference", "exudyn"):
        run(robot, "--engine", engine, "--truth", "--out", tmp_path / f"{engine}.csv")
    one, other = (load_recording(tmp_path / f"{engine}.csv") for engine in ("reference", "exudyn"))
    for name in ("joint1.position", "joint2.position"):
        # 1e-8 and 1e-6 per step are the engines' own tolerances
        np.testing.assert_allclose(one[name], other[name], atol=1e-5)


def test_simulate_command_uses_a_default_name_and_writes_no_file_after_an_error(
    robot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run(robot)
    assert (tmp_path / "two_link_arm.parquet").exists()
    arm: Robot = load_robot(robot).model_copy(update={"reference": None})
    save_robot(arm, tmp_path / "still.toml")
    with pytest.raises(InputError, match="reference"):
        run("still.toml", "--out", "still.csv")
    with pytest.raises(InputError, match="two_link_arm"):
        run("two_link_arn", "--out", "still.csv")
    assert not (tmp_path / "still.csv").exists()
