"""The benchmark scripts are in folders of at most a dozen modules."""

from __future__ import annotations

from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
MOST_MODULES = 12
ROOMS = [BENCHMARKS, *(path for path in sorted(BENCHMARKS.rglob("*")) if path.is_dir())]


@pytest.mark.parametrize("room", ROOMS, ids=lambda path: path.relative_to(BENCHMARKS.parent).as_posix())
def test_a_benchmark_folder_holds_at_most_a_dozen_modules(room: Path) -> None:
    assert len(list(room.glob("*.py"))) <= MOST_MODULES
