"""Results on work and precision: goals counted by error, and the cost of user functions."""

from __future__ import annotations

from pathlib import Path

import pytest
from rerun.chunk import RrdReader

pytest.importorskip("mujoco", reason="the benchmarks beside other engines need the extra [peers]")

from benchmarks.work_precision.manoeuvres import CASES
from benchmarks.work_precision.measured import Found, Point, share_at
from benchmarks.work_precision.pictures import DIGITS, write_curves
from benchmarks.work_precision.rivals import COMPILED, NATIVE, OWN
from benchmarks.work_precision.study import compiled_part, summary


def found(name: str, family: str, *times: tuple[float, float], share: float = 0.0) -> Found:
    """Our time is a millisecond at every error; the other's is given at 1e-3 and 1e-5."""
    own = [Point(OWN, "Rosenbrock", "", 1e-3, error, 0.0) for error in (9e-4, 9e-6)]
    other = [Point(family, "RK44", "", seconds, error, 0.0, share) for error, seconds in times]
    return Found(CASES[name], [*own, *other], {}, False, [])


FAST = found("arm, swinging", NATIVE, (1e-3, 5e-3), (1e-5, 30e-3))
SLOW = found("arm, tracking", NATIVE, (1e-3, 25e-3), (1e-5, 40e-3))
LOADED = found("flexible, LuGre", COMPILED, (1e-3, 50e-3), (1e-5, 200e-3), share=0.25)


def cells(text: str, start: str) -> list[str]:
    line = next(line for line in text.splitlines() if line.startswith(start))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_goals_are_counted_at_each_error_over_the_motions_that_reach_it() -> None:
    row = cells(summary([FAST, SLOW, LOADED]), "| rigid | no user functions")
    assert row[:4] == ["rigid", "no user functions", "20", "1 of 2 (5 to 25)"]
    assert row[5] == "2 of 2 (30 to 40)"
    assert row[6] == "-"
    flexible = cells(summary([FAST, SLOW, LOADED]), "| flexible | compiled")
    assert (flexible[3], flexible[5]) == ("0 of 1 (50 to 50)", "1 of 1 (200 to 200)")


def test_ratios_are_also_given_without_the_time_in_user_functions() -> None:
    row = cells(compiled_part([LOADED]), "| flexible, LuGre")
    assert row[2] == "50 (25 %: 37.5)"
    assert share_at(LOADED.points, (COMPILED,), 1e-5) == 0.25
    assert share_at(LOADED.points, (COMPILED,), 1e-9) is None


def test_the_rerun_file_has_a_curve_for_every_method(tmp_path: Path) -> None:
    path = tmp_path / "curves.rrd"
    write_curves([FAST, LOADED], path)
    entities = {
        str(chunk.entity_path).strip("/")
        for chunk in RrdReader(path).stream()
        if DIGITS in chunk.to_record_batch().schema.names
    }
    assert len(entities) == 4
