"""Drafts for logs of real machines, compared with manual maps."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from missing_physics.drafting import draft
from missing_physics.recordings import load_mapping, load_recording, mapping_from_toml
from robot_model import read_robot

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def data() -> Path:
    folder = Path(os.environ.get("MISSING_PHYSICS_DATA", ROOT.parent / "shared" / "recordings"))
    if not (folder / "emps" / "DATA_EMPS.mat").is_file():
        pytest.skip("the real recordings are not here; fetch them and set MISSING_PHYSICS_DATA")
    return folder


def found_in(folder: Path, name: str) -> Path:
    return next(iter(sorted(folder.rglob(name))))


@pytest.mark.parametrize(
    ("machine", "robot", "log", "channels"),
    [
        ("dfki_double_pendulum", "nominal_C1.toml", "C1_sysid_143524.csv", 6),
        ("kuka_kr300", "nominal.toml", "traj_A.mat", 30),  # torques before the gear, as most of them tell
        ("kuka_iiwa14", "", "fr_joint1_vel_p3.csv", 14),  # torques of the links on the drives
    ],
)
def test_a_draft_agrees_with_the_map_that_was_written(
    data: Path, machine: str, robot: str, log: str, channels: int
) -> None:
    own, path = ROOT / "examples" / machine, found_in(data / machine, log)
    overlay = None if robot else own / "overlay.toml"
    described, _ = read_robot(own / robot if robot else found_in(data / machine, "*.urdf"), overlay=overlay)
    drafted = draft(described, path)
    by_hand = load_recording(path, mapping=load_mapping(own / "map.toml"), check=False)
    recording = load_recording(path, mapping=mapping_from_toml(drafted.map), check=False)
    both = [name for name in by_hand if name in recording]
    assert len(both) == channels
    for name in both:
        ours = recording[name] - recording[name].mean()
        theirs = np.interp(recording.time, by_hand.time, by_hand[name] - by_hand[name].mean())
        assert np.linalg.norm(ours) == pytest.approx(np.linalg.norm(theirs), rel=0.02), name
        assert ours @ theirs >= 0, name
