"""`missing-physics crosscheck`: output, rejected input, and failures."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
import typer
from rerun.chunk import RrdReader
from typer.testing import CliRunner

import exudyn_model
import reference_model.simulation
from missing_physics.cli.commands.crosscheck import MOST_STEPS, Plan, plan_of, register
from robot_model import EffectUse, InputError, JointPD, Robot, load_robot, save_robot


def invoke(*words: object) -> Any:
    """What the command prints; its errors are raised."""
    app = typer.Typer()
    app.command("idle")(lambda: None)  # with one command alone typer would drop its name
    register(app)
    result = CliRunner().invoke(app, ["crosscheck", *map(str, words)])
    if result.exception:
        raise result.exception
    return result


def run(*words: object) -> str:
    """Standard output of the command."""
    return str(invoke(*words).stdout)


def short(arm: Robot, **changes: Any) -> Robot:
    """The robot with a motion of a fifth of a second."""
    assert arm.reference is not None
    reference = arm.reference.model_copy(update={"duration": 0.2, "sample_rate": 100.0})
    return arm.model_copy(update={"reference": reference, **changes})


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    save_robot(short(load_robot("two_link_arm")), tmp_path / "arm.toml")
    return tmp_path / "arm.toml"


def test_crosscheck_command_compares_both_engines(robot: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    table = run(robot, "--out", out)
    report = json.loads((out / "crosscheck.json").read_text())
    assert report["robot"] == "two_link_arm"
    assert {"joint1.position", "joint2.bending_moment", "robot.energy"} <= set(report["channels"])
    row = report["channels"]["joint1.position"]
    assert row["unit"] == "rad"
    assert 0 < row["rms"] <= row["max"] < 1e-6  # the engines agree to the error of Exudyn's step
    assert row["max_relative"] == pytest.approx(row["max"] / row["range"])
    # Exudyn is of second order: its error is a third of the difference that a run at twice the step makes.
    assert row["max"] == pytest.approx(row["bound"] / 3, rel=0.1)
    assert report["outside"] == []
    assert report["engines"]["exudyn"]["coarser_step"] == 2 * report["engines"]["exudyn"]["step"] == 2e-3
    assert "joint1.position" in table
    assert "only in the reference: " in table  # temperatures
    assert "All 29 channels stay inside the step error" in table
    paths = {str(chunk.entity_path).strip("/") for chunk in RrdReader(out / "comparison.rrd").stream()}
    for which in ("channels/{}/reference", "channels/{}/exudyn", "difference/{}", "difference/{}/band/above"):
        assert which.format(rr.escape_entity_path_part("joint1.position")) in paths
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(out / "comparison.rrd")]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_json_on_stdout_equals_the_file(robot: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    printed = run(robot, "--out", out, "--json", "--formulation", "tree", "--no-bounds")
    assert printed == (out / "crosscheck.json").read_text()
    assert json.loads(printed)["engines"]["exudyn"]["formulation"] == "tree"
    assert json.loads(printed)["outside"] is None


def test_duration_option_shortens_the_motion(robot: Path, tmp_path: Path) -> None:
    words = (robot, "--out", tmp_path / "out", "--json", "--no-bounds", "--duration")
    assert json.loads(run(*words, 0.05))["duration"] == pytest.approx(0.05)
    with pytest.raises(InputError, match=r"ends after 0\.2 s; give less, or lengthen"):
        run(*words, 5)
    with pytest.raises(InputError, match="must be positive"):
        run(*words, 0)


def refuse_to_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make any simulation an error of the test."""

    def never(*args: object, **settings: object) -> None:
        raise AssertionError("a simulation was begun")

    monkeypatch.setattr(reference_model.simulation, "simulate", never)
    monkeypatch.setattr(exudyn_model, "simulate", never)


@pytest.mark.parametrize(
    ("changes", "options", "words"),
    [
        ({"reference": None}, (), "reference"),
        ({"effects": (EffectUse.model_validate({"effect": "warp_drive", "at": "base"}),)}, (), "warp_drive"),
        ({}, ("--step", "-1"), "time step"),
    ],
)
def test_effects_unsupported_by_exudyn_are_rejected_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any], options: tuple[str], words: str
) -> None:
    save_robot(load_robot("two_link_arm").model_copy(update=changes), tmp_path / "arm.toml")
    refuse_to_run(monkeypatch)
    with pytest.raises(InputError, match=words):
        run(tmp_path / "arm.toml", "--out", tmp_path / "out", *options)
    assert not (tmp_path / "out").exists()


def test_flexible_links_in_a_tree_are_rejected_before_simulation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse_to_run(monkeypatch)
    with pytest.raises(InputError, match="its flexible links"):
        run("flexible_space_robot_planar", "--formulation", "tree", "--out", tmp_path / "out")


def test_diverged_exudyn_simulation_exits_with_code_2_and_no_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Speeds beyond 1e-3 rad/s stand for a diverging motion, which the reference integrates in peace."""
    save_robot(short(load_robot("two_link_arm")), tmp_path / "arm.toml")
    program = (
        "import exudyn_model.solve.stepping as s; s.LARGEST_SPEED = 1e-3; "
        "from missing_physics.cli import main; main()"
    )
    words = ["crosscheck", str(tmp_path / "arm.toml"), "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, "-c", program, *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stdout == ""
    last = done.stderr.strip().splitlines()[-1]
    assert "the motion diverges after" in last
    assert "(joint1 at " in last
    assert not (tmp_path / "out").exists()


def test_quiet_prints_nothing_and_progress_goes_to_stderr(robot: Path, tmp_path: Path) -> None:
    words = (robot, "--no-bounds", "--duration", "0.05", "--out", tmp_path / "out")
    loud, still = invoke(*words), invoke(*words, "--quiet")
    assert still.stdout == still.stderr == ""
    assert "joint1.position" in loud.stdout
    assert "Exudyn, steps of" in loud.stderr
    assert "Exudyn, steps of" not in loud.stdout


@pytest.mark.parametrize(
    ("rate", "tick", "step", "even"),
    [
        (500.0, 0.0, 1e-3, 1e-3),
        (1000.0, 0.0, 1e-3, 1e-3),  # the coarser run has every other instant, and a step of 2 ms
        (1000.0, 0.0, 0.7e-3, 0.5e-3),
        (200.0, 0.0, 1e-3, 5e-3 / 6),  # an even number of steps from instant to instant
        (500.0, 2e-3, 1e-3, 1e-3),
        (500.0, 1e-3, 1e-3, 0.5e-3),  # ticks must be met by the coarser run as well
        (500.0, 0.1, 1e-3, 1e-3),
    ],
)
def test_the_coarser_run_has_exactly_twice_the_step(
    rate: float, tick: float, step: float, even: float
) -> None:
    arm = load_robot("two_link_arm")
    assert arm.reference is not None
    reference = arm.reference.model_copy(update={"sample_rate": rate})
    controller = JointPD(kp=1.0, kd=1.0, sample_time=tick)
    arm = arm.model_copy(update={"reference": reference, "controller": controller})
    found = Plan(arm, step, "tree", "modal").even_step
    assert found == pytest.approx(even)
    for whole in (2 / rate if rate > 1 / (2 * step) else 1 / rate, *((tick,) if tick else ())):
        assert np.isclose(whole / (2 * found), round(whole / (2 * found)))


@pytest.mark.parametrize(("duration", "step"), [(2.0, 1e-3), (12.0, 3e-3), (400.0, 5e-3)])
def test_default_step_grows_with_the_duration_within_bounds(duration: float, step: float) -> None:
    arm = load_robot("two_link_arm")
    assert arm.reference is not None
    reference = arm.reference.model_copy(update={"duration": duration})
    long = arm.model_copy(update={"reference": reference})
    assert plan_of(long).step == pytest.approx(step)
    assert plan_of(long, step=1e-4).step == 1e-4
    assert duration / plan_of(long).step <= MOST_STEPS * max(1.0, duration / (MOST_STEPS * 5e-3)) + 1
