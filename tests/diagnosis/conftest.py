"""Settings of the tests of the diagnosis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pytest
from stated_errors import require_stated_errors

from missing_physics.diagnosis import pipeline
from missing_physics.results.result import Result
from reference_model.codegen.compiled import SWITCH
from robot_model import Recording, Robot


@pytest.fixture(autouse=True)
def _compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """The effects' formulas run as compiled C, as they do for users: they are few, and kept between runs."""
    monkeypatch.setenv(SWITCH, "on")


@pytest.fixture(autouse=True, scope="session")
def _files_have_the_stated_errors() -> Iterator[None]:
    """Every diagnosis that any test finishes: its robot file predicts what is stated of it."""
    compared = pipeline.compared

    def checked(result: Result, robot: Robot, recordings: Sequence[Recording], fitted: int) -> Result:
        found = compared(result, robot, recordings, fitted)
        require_stated_errors(found, recordings)
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "compared", checked)
        yield
