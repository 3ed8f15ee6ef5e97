"""Names of channels: places as in robot files, but no numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from missing_physics.recordings import load_recording
from missing_physics.recordings.channels.names import is_dotted, is_native


@pytest.mark.parametrize("place", ["joint1", "shoulder_pan_joint", "3dof", "_hidden", "a-b", "7"])
def test_places_of_channel_names_are_parsed(place: str) -> None:
    assert is_native(f"{place}.position")
    assert is_native(f"{place}.tip_acceleration.x")


@pytest.mark.parametrize("name", ["1.5", "1.5e-3", "-2.0", "1.2.3", "position", "a.b.c.d", ".position", ""])
def test_invalid_channel_names_are_rejected(name: str) -> None:
    assert not is_dotted(name)


def test_a_file_with_such_names_is_read(tmp_path: Path) -> None:
    rows = [f"{k / 100},{k % 7},{k % 5}" for k in range(100)]
    (tmp_path / "log.csv").write_text("\n".join(["time,3dof.position,wrist_1-joint.torque", *rows]))
    assert set(load_recording(tmp_path / "log.csv", check=False)) == {"3dof.position", "wrist_1-joint.torque"}
