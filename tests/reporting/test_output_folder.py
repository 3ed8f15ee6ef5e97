"""The folder of a diagnosis holds the files of one diagnosis."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from reporting_cases import hidden_friction, two_link_arm

from missing_physics.diagnosis import Result
from missing_physics.reporting import outputs as diagnose
from missing_physics.reporting.outputs import write_outputs
from missing_physics.results.result import Experiment
from robot_model import InputError

FILES = {"diagnosis.json", "report.html", "comparison.rrd", "robot.augmented.toml"}


def asking(*names: str) -> Result:
    """A result that asks for an experiment with each of these motions."""
    result = hidden_friction(seconds=2.0)
    asked = tuple(Experiment(("a", "b"), "run it", "it tells them apart", name) for name in names)
    diagnosis = replace(result.diagnosis, experiments=asked)
    return replace(result, diagnosis=diagnosis, experiment_motions=dict.fromkeys(names, "time\n0\n"))


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_earlier_experiments_are_removed_and_user_files_are_kept(tmp_path: Path) -> None:
    write_outputs(asking("experiment_1.csv", "experiment_2.csv"), two_link_arm(), tmp_path)
    assert names(tmp_path) == {*FILES, "experiment_1.csv", "experiment_2.csv"}
    (tmp_path / "experiment_3.csv").write_text("what the user recorded")
    write_outputs(asking("experiment_2.csv"), two_link_arm(), tmp_path)
    assert names(tmp_path) == {*FILES, "experiment_2.csv", "experiment_3.csv"}
    assert (tmp_path / "experiment_3.csv").read_text() == "what the user recorded"


@pytest.mark.parametrize(
    "content", ["[", "{}", '{"experiments": [{"motion": "../other.csv"}, {"motion": 3}]}']
)
def test_a_damaged_earlier_diagnosis_is_replaced(tmp_path: Path, content: str) -> None:
    (tmp_path / "other.csv").write_text("x")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "diagnosis.json").write_text(content)
    write_outputs(asking(), two_link_arm(), tmp_path / "out")
    assert names(tmp_path / "out") == FILES
    assert (tmp_path / "other.csv").exists()


@pytest.mark.parametrize("step", ["write_html", "write_rerun"])
def test_failure_leaves_the_earlier_diagnosis_unchanged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    write_outputs(asking("experiment_1.csv"), two_link_arm(), tmp_path / "out")
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}

    def full(*arguments: object, **more: object) -> None:
        raise InputError("cannot write it: No space left on device.")

    monkeypatch.setattr(diagnose, step, full)
    with pytest.raises(InputError, match="No space left"):
        write_outputs(hidden_friction(seconds=3.0), two_link_arm(), tmp_path / "out")
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
    assert names(tmp_path) == {"out"}
