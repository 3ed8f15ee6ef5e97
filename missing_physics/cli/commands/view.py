"""`missing-physics view`: the comparison in the rerun viewer."""

from __future__ import annotations

import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from robot_model import InputError
from robot_model.system.folders import finish

__all__ = ["register", "viewer_command"]

FILE_NAME = "comparison.rrd"
#: The viewer listens for more data; by default it would do so on every interface.
LOOPBACK = "127.0.0.1"
PROGRAM_FAULT = 1


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(view)


def view(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="folder that a diagnosis or a crosscheck was written to")
    ],
) -> None:
    """Open the comparison in DIR in the rerun viewer (bound to 127.0.0.1)."""
    finished = subprocess.run(viewer_command(folder), check=False)
    if finished.returncode:
        report = folder / "report.html"
        instead = f", and {report} shows the same in any browser" if report.is_file() else ""
        print(
            f"missing-physics: the rerun viewer ended with code {finished.returncode}; it needs a screen"
            f"{instead}.",
            file=sys.stderr,
        )
        raise typer.Exit(PROGRAM_FAULT)


def viewer_command(folder: Path) -> list[str]:
    """The command that opens `folder`'s comparison; raises `InputError` when there is none."""
    if not folder.is_dir():
        kind = "is a file" if folder.exists() else "does not exist"
        raise InputError(f"{folder} {kind}; name the folder that a diagnosis was written to with --out.")
    with suppress(OSError):  # a folder that may only be read
        finish(folder)
    path = folder / FILE_NAME
    if not path.is_file():
        raise InputError(
            f"{folder} holds no {FILE_NAME}; write it with: missing-physics diagnose ... --out {folder}"
        )
    return [sys.executable, "-m", "rerun", "--bind", LOOPBACK, "--port", "auto", str(path)]
