"""`missing-physics export`: the robot with what was found, for another simulator."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from robot_model import InputError, load_robot, write_atomically

__all__ = ["Format", "export", "register"]

AUGMENTED = "robot.augmented.toml"


class Format(StrEnum):
    """What is written."""

    mjcf = "mjcf"
    urdf = "urdf"
    json = "json"


#: Ends of the files that are written.
SUFFIXES = {Format.mjcf: ".xml", Format.urdf: ".urdf", Format.json: ".json"}


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(export)


def export(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="folder of a diagnosis, as given to --out", show_default=False),
    ],
    to: Annotated[Format, typer.Option("--to", help="format to write")],
    out: Annotated[
        Path | None, typer.Option("--out", help="file to write; left out, ROBOT.xml, .urdf or .json in DIR")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="print nothing")] = False,
) -> None:
    """Write the robot with what was found in DIR as a model that other simulators read.

    Bodies have their masses and inertias, joints their armature, damping, dry friction and springs, motors
    their gain. What the format cannot hold is listed, and computed by a Python module beside the file.
    """
    from missing_physics.export import code_of, content_of, json_of, mjcf_of, urdf_of
    from missing_physics.export.snippets import without_code
    from missing_physics.export.urdf import unsaid

    file = folder / AUGMENTED
    if not file.is_file():
        raise InputError(
            f"{folder} holds no {AUGMENTED}; give the folder that `missing-physics diagnose --out` wrote."
        )
    content = content_of(load_robot(file))
    text = {Format.mjcf: mjcf_of, Format.urdf: urdf_of, Format.json: json_of}[to](content)
    path = out or folder / f"{content.robot.name}{SUFFIXES[to]}"
    code, beside = code_of(content), path.with_name(f"{path.stem}_passive.py")
    write_atomically(path, text)
    if code:
        write_atomically(beside, code)
    if quiet:
        return
    typer.echo(f"{path}: {len(content.bodies)} bodies, {len(content.joints)} joints.")
    for sentence in unsaid(content) if to is Format.urdf else ():
        typer.echo(f"  URDF has no place for {sentence}.")
    if code:
        typer.echo(f"{beside}: what {to.value} cannot hold, as Python.")
    for use in content.left:
        lacks = " has no code: it acts in a gear, a sensor or a body" if use in without_code(content) else ""
        typer.echo(f"  {use.effect} at {use.at}{lacks}")
