"""The Python interface gives the same results as the commands."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import missing_physics as mp
from robot_model import EffectUse, save_robot

#: Of ours and of others, what an import must not load.
HEAVY = ("casadi", "scipy", "pandas", "rerun", "plotly", "exudyn", "numpy", "reference_model", "robot_model")


@pytest.fixture(scope="module")
def rubbing() -> mp.Recording:
    """Twelve seconds of the two-link arm with dry friction in its second joint, which its file lacks."""
    robot = mp.load_robot("two_link_arm")
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": 12.0, "sample_rate": 250.0})
    friction = EffectUse(effect="coulomb_friction", at="joint2", torque=3.0)  # type: ignore[call-arg]
    return mp.simulate(robot.model_copy(update={"reference": reference}).with_effects(friction), seed=3)


@pytest.fixture(scope="module")
def answer(rubbing: mp.Recording) -> mp.Answer:
    return mp.diagnose("two_link_arm", rubbing)


def test_import_loads_no_heavy_library() -> None:
    code = "import sys, missing_physics; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert not set(HEAVY) & {name.split(".")[0] for name in loaded.split()}


def test_every_public_name_exists_and_is_documented() -> None:
    for name in mp.__all__:
        assert getattr(mp, name).__doc__
    assert set(mp.__all__) <= set(dir(mp))
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        mp.nonsense  # noqa: B018


def test_diagnosis_from_python_names_friction_and_displays_itself(answer: mp.Answer) -> None:
    assert [(f.effect, f.location) for f in answer.findings] == [("coulomb_friction", "joint2")]
    assert answer.findings[0].parameters["torque"].value == pytest.approx(3.0, rel=1e-2)
    assert repr(answer) == "<Answer on two_link_arm: explained, Coulomb friction at joint2>"
    assert answer.verdict == "explained"
    assert "EXPLAINED: Coulomb friction at joint2" in answer.summary()
    assert max(map(len, answer.summary(width=60).splitlines())) <= 60
    assert "Coulomb friction at joint2" in answer._repr_html_()
    uses = {(use.effect, use.at) for use in answer.robot.effects}
    # Bristles that are stiffer than the recording resolves stick at rest as dry friction does.
    assert {("coulomb_friction", "joint2"), ("lugre_friction", "joint2")} & uses


def test_figure_shows_the_requested_channel(answer: mp.Answer) -> None:
    figure = answer.plot("joint1.torque")
    assert "joint1.torque" in figure.layout.title.text
    assert "joint2" in answer.plot().layout.title.text
    with pytest.raises(mp.InputError, match=r"'joint9\.torque' was not compared; compared were"):
        answer.plot("joint9.torque")


def test_saved_files_equal_those_of_the_command_line(answer: mp.Answer, tmp_path: Path) -> None:
    answer.save(tmp_path / "out")
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"diagnosis.json", "report.html", "comparison.rrd", "robot.augmented.toml"} <= written
    found = json.loads((tmp_path / "out" / "diagnosis.json").read_text("utf-8"))
    assert found["findings"][0]["location"] == "joint2"
    again = mp.load_robot(tmp_path / "out" / "robot.augmented.toml")
    assert again == answer.robot


def test_inspection_is_the_same_for_paths_objects_and_tables(rubbing: mp.Recording, tmp_path: Path) -> None:
    file, robot = tmp_path / "arm.csv", tmp_path / "arm.toml"
    columns = {"time": rubbing.time, **rubbing.channels}
    np.savetxt(
        file, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="",
        fmt="%.17g",
    )  # fmt: skip
    save_robot(mp.load_robot("two_link_arm"), robot)
    told = [mp.inspect(one, robot).to_dict() for one in (file, rubbing, columns)]
    kept = [
        (one["samples"], one["can_tell"], sorted(channel["name"] for channel in one["channels"]))
        for one in told
    ]
    assert kept[0] == kept[1] == kept[2]
    assert "joint1.torque" in mp.inspect(file).summary()
    assert repr(mp.inspect(file)).startswith(f"<Inspection of {file}: ")


def test_names_are_escaped_in_a_notebook(rubbing: mp.Recording) -> None:
    from dataclasses import replace

    page = mp.inspect(replace(rubbing, source="<script>x</script>\x1b[31m"))._repr_html_()
    assert "<script>" not in page
    assert "\x1b" not in page


def test_wrong_arguments_are_reported_in_a_sentence(tmp_path: Path) -> None:
    robot = mp.load_robot("single_axis")
    with pytest.raises(mp.InputError, match="there is no engine 'drake'"):
        mp.simulate(robot, engine="drake")  # type: ignore[arg-type]
    with pytest.raises(mp.InputError, match="was read already"):
        mp.load_robot(robot, overlay=tmp_path / "drive.toml")
    with pytest.raises(mp.InputError, match="belong in a map"):
        mp.load_recording("log.csv", units={"time": "ms"})
    with pytest.raises(mp.InputError):
        mp.diagnose(robot, tmp_path / "missing.csv")
