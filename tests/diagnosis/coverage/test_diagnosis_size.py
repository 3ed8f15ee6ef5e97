"""A recording that is too long is rejected before any computation."""

from __future__ import annotations

import numpy as np
import pytest

from missing_physics.diagnosis import diagnose
from missing_physics.motion import recorded
from robot_model import InputError, Recording, load_robot

MOST = 4000


@pytest.fixture(autouse=True)
def _limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A limit that short recordings exceed."""
    monkeypatch.setattr(recorded, "MOST_SAMPLES", MOST)


def test_too_many_rows_are_rejected_with_one_sentence() -> None:
    time = np.arange(MOST + 1) * 1e-3
    recording = Recording(time, {"joint1.position": time, "joint1.torque": time}, source="long.parquet")
    with pytest.raises(InputError, match=rf"long\.parquet has {MOST + 1} samples") as error:
        diagnose(load_robot("single_axis"), [recording])
    assert str(MOST) in str(error.value)
    assert "\n" not in str(error.value)


def test_row_limit_decreases_with_the_square_of_the_number_of_joints() -> None:
    count = MOST // 4 + 1
    time = np.arange(count) * 1e-3
    channels = {f"joint{k}.{what}": time for k in (1, 2) for what in ("position", "torque")}
    with pytest.raises(InputError, match="2 joints takes at most 1000"):
        diagnose(load_robot("two_link_arm"), [Recording(time, channels)])
