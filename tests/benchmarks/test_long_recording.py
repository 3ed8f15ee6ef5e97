"""The pages on the time of diagnoses and on one minute at 1 kHz, made from a few seconds."""

from pathlib import Path

import pytest

from benchmarks.speed import diagnosis_time
from benchmarks.speed.diagnosis_time import CASES, FIRST, STAGES, Case, Stages, measured
from benchmarks.speed.long_recording import answer_facts, page, recorded, timed
from missing_physics.recordings import load_recording
from robot_model import load_robot


def test_a_short_recording_is_made_timed_and_reported(tmp_path: Path) -> None:
    hidden = recorded(tmp_path, 2.0)
    assert not load_robot(tmp_path / "robot.toml").effects
    assert hidden
    assert len(load_recording(tmp_path / "recording.csv")) == 2001
    found = timed(tmp_path)
    assert found["megabytes"] > 50
    assert found["wall"] > 0.5
    text = page(found, hidden, seconds=2.0, samples=2001)
    assert found["verdict"] in text
    assert all(label in text for label in hidden)
    assert "`lugre_friction@joint1` (load_coefficient 0.1, " in text


def test_the_page_lists_truth_next_to_names_and_the_unsearched_effects() -> None:
    answer = {
        "verdict": "explained",
        "findings": [
            {"effect": "lugre_friction", "location": "joint1", "probability": 0.95},
            {"effect": "load_dependent_friction", "location": "joint1", "probability": 0.82},
        ],
        "could_not_tell": [
            "Its bristle damping is not told.",
            "Not searched for, since no torque along a motion shows them: slosh.",
        ],
    }
    found = {"wall": 1.0, "processor": 1.0, "megabytes": 60.0, "summary": "said", **answer_facts(answer)}
    hidden = ("lugre_friction@joint1", "viscous_friction@joint2")
    text = page(found, hidden, seconds=2.0, samples=2001)
    assert "| `lugre_friction@joint1` | yes | 0.95 |" in text
    assert "| `viscous_friction@joint2` | yes | not named |" in text
    assert "| `load_dependent_friction@joint1` | no | 0.82 |" in text
    assert "- Not searched for, since no torque along a motion shows them: slosh" in text
    assert "- Its bristle damping" not in text
    assert "Not every effect of the catalogue was searched for" in text
    assert "every effect of the" not in text.replace("Not every effect of the", "")
    found["not_searched"] = []
    assert "Not every effect" not in page(found, hidden, seconds=2.0, samples=2001)


def test_stages_begin_with_their_phrases() -> None:
    now = iter([0.0, 1.0, 3.0, 6.0])
    stages = Stages(lambda: next(now))
    stages("fitting the standard model")
    stages("Coulomb friction at joint1")  # within that stage
    stages("weighing hypotheses")
    stages.end()
    standard, weighing = STAGES["fitting the standard model"], STAGES["weighing hypotheses"]
    assert stages.seconds == {FIRST: 1.0, standard: 2.0, weighing: 3.0}


def test_a_short_diagnosis_is_measured_and_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    short = Case("two joints, 6 s", 1e-9, lambda: diagnosis_time.recorded_chain(2, 6.0, 100.0))
    monkeypatch.setitem(CASES, "short", short)
    times = measured("short")
    assert times["samples"] == 601
    assert times["duration"] == pytest.approx(6.0)
    assert sum(times["stages"].values()) == pytest.approx(times["wall"], rel=0.05, abs=0.05)
    assert set(times["stages"]) <= {FIRST, *STAGES.values()}
    text = diagnosis_time.page([times], ["another machine"])
    assert "| two joints, 6 s | 6 | 601 |" in text
    assert "Goals of time missed: two joints, 6 s." in text
    assert "Not here, so not timed: another machine." in text
