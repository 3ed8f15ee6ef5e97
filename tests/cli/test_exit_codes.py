"""Messages and exit codes for unusable input and for a full disk or memory."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from missing_physics import cli
from missing_physics.challenge.processes import stage
from robot_model import InputError, OutOfMemoryError, lacks_room, write_atomically


def ended(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: Any
) -> tuple[int, str]:
    monkeypatch.setattr(cli, "app", command)
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert isinstance(end.value.code, int)
    return end.value.code, capsys.readouterr().err


def raising(error: Exception) -> Any:
    def command(**_: object) -> None:
        raise error

    return command


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (InputError("no such joint."), 2, "missing-physics: no such joint.\n"),
        (
            OSError(errno.ENOSPC, "No space left on device", "a.html"),
            75,
            "No space left on device (a.html).\n",
        ),
        (OSError(errno.EIO, "Input/output error"), 75, "the system refused: Input/output error.\n"),
        (MemoryError(), 75, "more memory than is free; close other programs, or cut it.\n"),
        (OutOfMemoryError("a.csv is too much"), 75, "missing-physics: a.csv is too much.\n"),
        (RuntimeError("std::bad_alloc"), 75, "more memory than is free; close other programs, or cut it.\n"),
        (OSError("malloc of size 8589934592 failed"), 75, "malloc of size 8589934592 failed.\n"),
        (PermissionError(errno.EACCES, "Permission denied", "b"), 2, "Permission denied (b).\n"),
    ],
)
def test_errors_give_one_sentence_and_an_exit_code(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: Exception,
    code: int,
    words: str,
) -> None:
    found, message = ended(monkeypatch, capsys, raising(error))
    assert found == code
    assert message.startswith("missing-physics: ")
    assert message.endswith(words)
    assert message.count("\n") == 1


def test_full_disk_is_distinguished_from_unusable_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A step of a challenge that ends like this has no answer yet, and is tried again."""

    def full(*args: Any, **kwargs: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "open", full)
    code, message = ended(monkeypatch, capsys, lambda **_: write_atomically(tmp_path / "a", "x"))
    assert code == cli.TRY_AGAIN == stage.STOPPED
    assert "cannot write" in message
    monkeypatch.undo()
    (tmp_path / "file").touch()
    code, _ = ended(monkeypatch, capsys, lambda **_: write_atomically(tmp_path / "file" / "a", "x"))
    assert code == cli.UNUSABLE_INPUT == stage.UNUSABLE


def test_program_errors_are_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli, "app", raising(RuntimeError("no such state")))
    with pytest.raises(RuntimeError, match="no such state"):
        cli.main()


def test_lack_of_memory_is_distinguished_from_unusable_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def command(**_: object) -> None:
        try:
            raise MemoryError
        except MemoryError:
            raise InputError("a.npz cannot be read") from None

    assert ended(monkeypatch, capsys, command)[0] == cli.TRY_AGAIN


def test_errors_of_full_disk_or_memory_are_recognised() -> None:
    assert lacks_room(OSError(errno.ENOSPC, ""))
    assert lacks_room(MemoryError())
    assert not lacks_room(OSError(errno.ENOENT, ""))
    assert not lacks_room(InputError("x"))
    assert not lacks_room(ValueError())


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["foo"], "No such command 'foo'; see missing-physics --help."),
        (["diagnose"], "Missing argument"),
        (["diagnose", "a.toml", "b.csv", "--cutoff", "abc"], "see missing-physics diagnose --help."),
        (["challenge", "--cases", "0"], "'--cases'"),
        (["inspect", "--no-such-option"], "--no-such-option"),
    ],
)
def test_invalid_command_line_gives_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    monkeypatch.setattr(sys, "argv", ["missing-physics", *words])
    with pytest.raises(SystemExit) as end:
        cli.main()
    out, message = capsys.readouterr()
    assert (end.value.code, out, message.count("\n")) == (cli.UNUSABLE_INPUT, "", 1)
    assert message.startswith("missing-physics: ")
    assert told in message


def test_empty_command_line_prints_the_help(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["missing-physics"])
    with pytest.raises(SystemExit) as end:
        cli.main()
    out, message = capsys.readouterr()
    assert (end.value.code, message) == (cli.UNUSABLE_INPUT, "")
    assert "diagnose" in out


@pytest.mark.parametrize(("stop", "code"), [(KeyboardInterrupt(), 130), (typer.Exit(3), 3)])
def test_interrupt_and_closed_pipe_have_exit_codes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], stop: BaseException, code: int
) -> None:
    app = typer.Typer()

    @app.command()
    def command() -> None:
        raise stop

    monkeypatch.setattr(sys, "argv", ["missing-physics"])
    found, _ = ended(monkeypatch, capsys, app)
    assert found == code
