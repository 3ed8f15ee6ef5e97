from __future__ import annotations

import pytest
from recorded_arm import ROBOT

from robot_model import Robot, robot_from_toml


@pytest.fixture(scope="session")
def arm() -> Robot:
    return robot_from_toml(ROBOT)
