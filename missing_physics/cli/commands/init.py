"""`missing-physics init`: draft the map of a log, and an overlay for its robot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from missing_physics.cli.recordings import GIGABYTE, LIMIT, SizeLimitOption
from missing_physics.cli.robots import ROBOT_HELP, OverlayOption, open_robot
from robot_model import InputError, write_atomically
from robot_model.input.errors import one_sentence

__all__ = ["init", "register"]


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(init)


def init(
    robot: Annotated[str, typer.Argument(help=ROBOT_HELP)],
    log: Annotated[Path, typer.Argument(help="recording, in any format that is read", show_default=False)],
    overlay: OverlayOption = None,
    out: Annotated[Path, typer.Option("--out", help="folder for the drafts")] = Path(),
    force: Annotated[bool, typer.Option("--force", help="replace drafts that are there")] = False,
    size_limit: SizeLimitOption = LIMIT,
    quiet: Annotated[bool, typer.Option("--quiet", help="print nothing but errors")] = False,
) -> None:
    """Draft the map of LOG, and an overlay for ROBOT.

    Channels, units, signs and torque constants are guessed from names, ranges and contradictions between
    channels. Both files say what was guessed and why, and ask a question where the recording gives no answer.
    """
    from missing_physics.drafting import draft  # it imports the diagnosis, which other commands do not need

    model = open_robot(robot, overlay, quiet=quiet)
    stem = Path(robot).stem.split(".")[0]
    names = out / f"{log.stem}.map.toml", out / f"{stem}.overlay.toml"
    for path in () if force else names:
        if path.exists():
            raise InputError(f"{path} is there already; choose another folder (--out), or add --force.")
    found = draft(model, log, size_limit=size_limit * GIGABYTE)
    written = [(path, text) for path, text in zip(names, (found.map, found.overlay)) if text]
    out.mkdir(parents=True, exist_ok=True)
    for path, text in written:
        write_atomically(path, text)
    if quiet:
        return
    for note in found.notes:
        typer.echo(f"Note: {one_sentence(note)}")
    for entry in found.entries:
        unit = entry.table.get("unit", "")
        scale = f" x {entry.table['scale']:.6g}" if "scale" in entry.table else ""
        typer.echo(
            f"  {entry.channel:32} {json.dumps(entry.column.label, ensure_ascii=True)} {unit}{scale}".rstrip()
        )
    typer.echo(
        f"{', '.join(str(path) for path, _ in written)}: {len(found.entries)} channels, "
        f"{found.questions} questions (lines with '# ?')."
    )
    if found.overlay and overlay is not None:
        typer.echo(f"Put what is right of {names[1]} into {overlay}: one overlay is taken.")
    used = overlay or (names[1] if found.overlay else None)
    with_overlay = f" --overlay {used}" if used else ""
    typer.echo(f"Next: missing-physics inspect {log} --map {names[0]} --robot {robot}{with_overlay}")
