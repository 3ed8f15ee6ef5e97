"""The page on one minute at 1 kHz, made from one second."""

from pathlib import Path

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
