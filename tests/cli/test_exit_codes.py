"""What the front door says when the input is unusable, and when the machine refuses."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Any

import pytest

from missing_physics import cli
from missing_physics.challenge import stage
from robot_model import InputError, lacks_room, write_atomically


def ended(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: Any
) -> tuple[int, str]:
    monkeypatch.setattr(cli, "app", command)
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert isinstance(end.value.code, int)
    return end.value.code, capsys.readouterr().err


def raising(error: Exception) -> Any:
    def command() -> None:
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
        (PermissionError(errno.EACCES, "Permission denied", "b"), 2, "Permission denied (b).\n"),
    ],
)
def test_one_sentence_and_a_code(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: Exception,
    code: int,
    words: str,
) -> None:
    found, said = ended(monkeypatch, capsys, raising(error))
    assert found == code
    assert said.startswith("missing-physics: ")
    assert said.endswith(words)
    assert said.count("\n") == 1


def test_a_full_disk_behind_a_sentence_is_told_from_unusable_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A step of a challenge that ends like this has no answer yet, and is tried again."""

    def full(*args: Any, **kwargs: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("tempfile.mkstemp", full)
    code, said = ended(monkeypatch, capsys, lambda: write_atomically(tmp_path / "a", "x"))
    assert code == cli.TRY_AGAIN == stage.STOPPED
    assert "cannot write" in said
    monkeypatch.undo()
    (tmp_path / "file").touch()
    code, _ = ended(monkeypatch, capsys, lambda: write_atomically(tmp_path / "file" / "a", "x"))
    assert code == cli.UNUSABLE_INPUT == stage.UNUSABLE


def test_what_lacks_room() -> None:
    assert lacks_room(OSError(errno.ENOSPC, ""))
    assert not lacks_room(OSError(errno.ENOENT, ""))
    assert not lacks_room(InputError("x"))
    assert not lacks_room(ValueError())
