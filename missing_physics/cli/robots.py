"""The argument that names a robot, common to all commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robot_model import Robot, read_robot

__all__ = ["ROBOT_HELP", "OverlayOption", "open_robot"]

ROBOT_HELP = "robot file (TOML, URDF, xacro or MJCF), or the name of a shipped robot"

OverlayOption = Annotated[
    Path | None,
    typer.Option(
        "--overlay",
        help="TOML file with keys of a robot file that replace or complete those of ROBOT, such as what a "
        "URDF or MJCF file cannot hold. By default NAME.overlay.toml next to such a file, if it exists.",
    ),
]


def open_robot(robot: str, overlay: Path | None, *, quiet: bool = False) -> Robot:
    """The robot; messages about how its file was read are printed to stderr."""
    found, notes = read_robot(robot, overlay=overlay)
    for note in () if quiet else notes:
        typer.echo(f"{robot}: {note}", err=True)
    return found
