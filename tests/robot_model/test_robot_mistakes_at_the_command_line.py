"""At the command line a mistake in a robot file is one line on stderr, exit code 2, and no file."""

from __future__ import annotations

from pathlib import Path

import pytest
from robot_mistakes import MISTAKES, Mistake

from missing_physics.cli import UNUSABLE_INPUT, main

#: Sentences are tested without the command; every eighth comes through it in the quick tests.
SOME = 8


@pytest.mark.parametrize(
    "mistake",
    [
        pytest.param(mistake, id=mistake.kind, marks=pytest.mark.proof if place % SOME else ())
        for place, mistake in enumerate(MISTAKES)
    ],
)
def test_simulate_reports_the_mistake_and_writes_nothing(
    mistake: Mistake,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(mistake.text)
    out = tmp_path / "out" / "recording.csv"
    monkeypatch.setattr("sys.argv", ["missing-physics", "simulate", str(path), "--out", str(out)])
    with pytest.raises(SystemExit) as left:
        main()
    printed = capsys.readouterr()
    assert left.value.code == UNUSABLE_INPUT
    assert printed.err == f"missing-physics: {mistake.told_of(path)}\n"
    assert printed.out == ""
    assert [item.name for item in tmp_path.iterdir()] == ["arm.toml"]
