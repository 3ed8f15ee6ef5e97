"""Recordings made by the tests, and the folder of real ones where there is one."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from robot_model import Recording

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def real() -> Path:
    """The folder of public real recordings; tests that need it are skipped where it is not."""
    for folder in (os.environ.get("MISSING_PHYSICS_DATA"), ROOT.parent / "shared" / "recordings"):
        if folder and (Path(folder) / "emps" / "DATA_EMPS.mat").is_file():
            return Path(folder)
    pytest.skip("the real recordings are not here; fetch them and set MISSING_PHYSICS_DATA")


@pytest.fixture(scope="session")
def examples() -> Path:
    return ROOT / "examples"


@pytest.fixture
def swing() -> Recording:
    """A joint that swings at two frequencies, with a torque; 4 s at 250 Hz, noise free."""
    t = np.arange(1000) / 250.0
    a, b = 2 * np.pi * 0.7, 2 * np.pi * 1.9
    return Recording(
        time=t,
        channels={
            "joint1.position": np.sin(a * t) + 0.3 * np.sin(b * t),
            "joint1.velocity": a * np.cos(a * t) + 0.3 * b * np.cos(b * t),
            "joint1.torque": -(a**2) * np.sin(a * t) - 0.3 * b**2 * np.sin(b * t),
        },
        source="swing",
    )
