"""The page of full-length crosschecks for a robot that exceeds its band, without running one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.crosscheck import full_length


def result(inside: float) -> dict[str, Any]:
    channel = {
        **{"unit": "rad", "max": 2e-6, "rms": 1e-6, "max_relative": 2e-6, "rms_relative": None},
        **{"bound": 1e-6, "inside": inside, "explained": inside > 0.999},
    }
    return {
        **{"robot": "two_link_arm", "duration": 20.0, "samples": 3, "summary": "Words.", "notes": []},
        **{"worst": "joint1.position", "channels": {"joint1.position": channel}, "commit": "abc"},
        "outside": [] if channel["explained"] else ["joint1.position"],
        "engines": {"exudyn": {"step": 1e-3}},
        "seconds": {"reference": (1.0, 0.5)},
    }


@pytest.mark.parametrize(("inside", "shown"), [(1.0, "yes"), (0.5, "50.00 %")])
def test_a_channel_outside_its_band_is_reported_and_fails(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, inside: float, shown: str
) -> None:
    monkeypatch.setattr(full_length, "FOLDER", tmp_path / "kept")
    monkeypatch.setattr(full_length, "EVIDENCE", tmp_path)
    monkeypatch.setattr(full_length, "run", lambda name: result(inside))
    assert full_length.main(["two_link_arm"]) == (0 if shown == "yes" else 1)
    page = (tmp_path / "crosscheck_full_length.md").read_text()
    assert f"| `joint1.position` | rad | 2.0e-06 | 1.0e-06 | 2.0e-06 | - | 1.0e-06 | {shown} |" in page
    assert "| 1.0 (0.5) | - | - | - | abc |" in page


def test_robots_that_were_not_rerun_stay_on_the_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(full_length, "FOLDER", tmp_path / "kept")
    monkeypatch.setattr(full_length, "EVIDENCE", tmp_path)
    monkeypatch.setattr(full_length, "run", lambda name: {**result(1.0), "robot": name})
    full_length.main(["single_axis"])
    full_length.main(["two_link_arm"])
    page = (tmp_path / "crosscheck_full_length.md").read_text()
    assert "## single_axis" in page
    assert "## two_link_arm" in page
