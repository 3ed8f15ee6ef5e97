"""`missing-physics export`: the augmented robot, for another simulator."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from missing_physics.cli.robots import OverlayOption
from robot_model import InputError, load_robot, write_atomically

if TYPE_CHECKING:
    from missing_physics.export import Content

__all__ = ["Format", "export", "register"]

AUGMENTED = "robot.augmented.toml"


class Format(StrEnum):
    """Output formats."""

    mjcf = "mjcf"
    urdf = "urdf"
    json = "json"


#: Suffixes of the written files.
SUFFIXES = {Format.mjcf: ".xml", Format.urdf: ".urdf", Format.json: ".json"}


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(export)


def export(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="folder of a diagnosis, as given to --out", show_default=False),
    ],
    to: Annotated[
        Format | None, typer.Option("--to", help="format to write; with --into, by default that of its file")
    ] = None,
    into: Annotated[
        Path | None,
        typer.Option(
            "--into",
            metavar="ROBOT",
            help="the URDF or MJCF file that was diagnosed: a copy of it is written with nothing changed but "
            "the numbers that were found",
        ),
    ] = None,
    overlay: OverlayOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="file to write; by default ROBOT.xml, .urdf, .json or that of --into in DIR"
        ),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="print nothing")] = False,
) -> None:
    """Write the robot with what was found in DIR as a model that other simulators read.

    Bodies have their masses and inertias, joints their armature, damping, dry friction and springs, motors
    their gain. What the format cannot hold is listed, and computed by a Python module next to the file.
    """
    from missing_physics.export import code_of, content_of
    from missing_physics.export.snippets import without_code

    file = folder / AUGMENTED
    if not file.is_file():
        raise InputError(
            f"{folder} holds no {AUGMENTED}; give the folder that `missing-physics diagnose --out` wrote."
        )
    content = content_of(load_robot(file))
    made = _anew(content, to, folder) if into is None else _into(content, into, overlay, to, folder)
    path = out or made.path
    if into is not None and path.resolve() == into.resolve() and out is None:
        raise InputError(f"{into} lies in {folder} and would be replaced; name another file with --out.")
    code, module = code_of(content), path.with_name(f"{path.stem}_passive.py")
    write_atomically(path, made.text)
    if code:
        write_atomically(module, code)
    if quiet:
        return
    typer.echo(f"{path}: {made.words}.")
    for sentence in made.unsaid:
        typer.echo(f"  {made.kind.upper()} cannot hold {sentence}.")
    if code:
        typer.echo(f"{module}: what {made.kind} cannot hold, as Python.")
    for use in content.left:
        lacks = " has no code: it acts in a gear, a sensor or a body" if use in without_code(content) else ""
        typer.echo(f"  {use.effect} at {use.at}{lacks}")


@dataclass(frozen=True)
class _Made:
    """A file to write: its format, text, default path and messages."""

    kind: str
    text: str | bytes
    path: Path
    words: str
    unsaid: tuple[str, ...] = ()


def _anew(content: Content, to: Format | None, folder: Path) -> _Made:
    from missing_physics.export import json_of, mjcf_of, urdf_of
    from missing_physics.export.urdf import unsaid

    if to is None:
        raise InputError("give --to mjcf, urdf or json, or --into with the robot file that was diagnosed.")
    text = {Format.mjcf: mjcf_of, Format.urdf: urdf_of, Format.json: json_of}[to](content)
    words = f"{len(content.bodies)} bodies, {len(content.joints)} joints"
    left = tuple(unsaid(content)) if to is Format.urdf else ()
    return _Made(to.value, text, folder / f"{content.robot.name}{SUFFIXES[to]}", words, left)


def _into(content: Content, into: Path, overlay: Path | None, to: Format | None, folder: Path) -> _Made:
    from missing_physics.export import edited_file

    edited = edited_file(content, into, overlay=overlay)
    if to is not None and to.value != edited.kind:
        raise InputError(f"{into} is {edited.kind.upper()}; leave out --to, or --into to write {to.value}.")
    places: dict[str, list[str]] = {}
    for phrase in edited.changed:
        what, _, where = phrase.partition(" of ")
        places.setdefault(what, []).append(where)
    changed = "; ".join(
        f"{what} of {', '.join(where)}" if any(where) else what for what, where in places.items()
    )
    words = (
        f"nothing changed but {changed}"
        if changed
        else "nothing changed: such a file cannot hold what was found"
    )
    return _Made(edited.kind, edited.text, folder / into.name, words, edited.unsaid)
