"""Settings of the tests of the diagnosis."""

from __future__ import annotations

import pytest

from reference_model.compiled import SWITCH


@pytest.fixture(autouse=True)
def _compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """The effects' formulas run as compiled C, as they do for users: they are few, and kept between runs."""
    monkeypatch.setenv(SWITCH, "on")
