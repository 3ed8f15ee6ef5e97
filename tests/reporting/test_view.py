"""`missing-physics view`: bound to this machine only; a sentence and exit code 2 without a file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer

from missing_physics.cli.commands import view
from robot_model import InputError


def test_viewer_listens_on_this_machine_only(tmp_path: Path) -> None:
    file = tmp_path / "comparison.rrd"
    file.write_bytes(b"")
    command = view.viewer_command(tmp_path)
    assert command[command.index("--bind") + 1] == "127.0.0.1"
    assert command[-1] == str(file)


def test_options_exist_in_the_installed_viewer() -> None:
    text = subprocess.run([sys.executable, "-m", "rerun", "--help"], capture_output=True, text=True).stdout
    assert "--bind <BIND>" in text
    assert "`auto`" in text


def test_absent_file_or_folder_gives_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"holds no comparison\.rrd; write it with"):
        view.viewer_command(tmp_path)
    with pytest.raises(InputError, match="does not exist; name the folder"):
        view.viewer_command(tmp_path / "nowhere")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file; name the folder"):
        view.viewer_command(tmp_path / "file")


def test_exit_code_2_from_the_command_line(tmp_path: Path) -> None:
    program = "from missing_physics.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", program, "view", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "holds no comparison.rrd" in done.stderr


def test_failing_viewer_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "comparison.rrd").write_bytes(b"")
    monkeypatch.setattr(view.subprocess, "run", lambda *a, **k: SimpleNamespace(returncode=3))
    with pytest.raises(typer.Exit) as stop:
        view.view(tmp_path)
    assert stop.value.exit_code == 1
    assert "it needs a screen" in capsys.readouterr().err
