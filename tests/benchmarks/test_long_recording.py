"""The page about one minute at 1 kHz, made of one second."""

from pathlib import Path

from benchmarks.long_recording import page, recorded, timed
from missing_physics.recordings import load_recording
from robot_model import load_robot


def test_a_short_one_is_recorded_timed_and_told(tmp_path: Path) -> None:
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
