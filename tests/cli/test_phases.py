"""Without a terminal, every phase of a long command prints a line."""

from __future__ import annotations

import time

import pytest

from missing_physics.cli import progress
from missing_physics.cli.progress import phases


def lines(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Of stderr, without the seconds in front."""
    message = capsys.readouterr()
    assert message.out == ""
    return [line.split(" s  ", 1)[1] for line in message.err.splitlines()]


def waited_for(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The next lines, as soon as there are any."""
    until = time.monotonic() + 5.0
    while time.monotonic() < until:
        if found := lines(capsys):
            return found
        time.sleep(0.005)
    return []


def test_one_progress_line_is_printed_per_phase(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "HELD", 0.02)
    with phases(quiet=False) as tell:
        tell("reading x[/y].csv")
        assert waited_for(capsys) == ["reading x[/y].csv"]  # while it lasts, not when the command ends
        tell("fitting")
        assert lines(capsys) == ["fitting"]
        tell("fitting")
        tell("reading x[/y].csv")
    assert lines(capsys) == ["reading x[/y].csv"]


def test_short_run_prints_its_phases(capsys: pytest.CaptureFixture[str]) -> None:
    with phases(quiet=False) as tell:
        tell("reading")
        tell("fitting")
    assert lines(capsys) == ["reading", "fitting"]


def test_quick_failure_prints_only_its_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    def command() -> None:
        with phases(quiet=False) as tell:
            tell("reading")
            raise ValueError("unusable")

    with pytest.raises(ValueError, match="unusable"):
        command()
    assert lines(capsys) == []


def test_progress_is_printed_for_every_tenth_of_a_phase(capsys: pytest.CaptureFixture[str]) -> None:
    with phases(quiet=False, measured=True) as tell:
        for done in range(101):
            tell("diagnosing 100 cases", done / 100)
        tell("scoring 100 cases", 0.0)
    parts = [f"diagnosing 100 cases: {part} %" for part in range(10, 101, 10)]
    assert lines(capsys) == ["diagnosing 100 cases", *parts, "scoring 100 cases"]


def test_quiet_option_prints_no_progress(capsys: pytest.CaptureFixture[str]) -> None:
    with phases(quiet=True) as tell:
        tell("fitting")
        tell("scoring", 0.5)
    assert capsys.readouterr() == ("", "")
