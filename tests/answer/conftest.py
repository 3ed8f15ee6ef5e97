"""The machine of the tests of answers."""

from __future__ import annotations

import pytest

from robot_model import Robot, load_robot


@pytest.fixture(scope="session")
def arm() -> Robot:
    robot = load_robot("two_link_arm")
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": 12.0, "sample_rate": 250.0})
    return robot.model_copy(update={"reference": reference})
