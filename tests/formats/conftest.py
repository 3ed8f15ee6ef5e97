"""Robot files of the tests, and those of real machines if their folder exists."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def files() -> Path:
    return Path(__file__).parent / "files"


@pytest.fixture(scope="session")
def real() -> Path:
    """The folder of public real recordings, which holds their robots' files."""
    for folder in (os.environ.get("MISSING_PHYSICS_DATA"), ROOT.parent / "shared" / "recordings"):
        if folder and (Path(folder) / "kuka_iiwa14" / "iiwa14.urdf").is_file():
            return Path(folder)
    pytest.skip("the real recordings are not here; fetch them and set MISSING_PHYSICS_DATA")
