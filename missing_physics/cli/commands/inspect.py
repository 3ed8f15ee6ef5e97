"""`missing-physics inspect`: a recording's content, its problems, and what can be identified from it."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from missing_physics.cli.recordings import GIGABYTE, LIMIT, SizeLimitOption
from missing_physics.cli.robots import ROBOT_HELP, OverlayOption, open_robot
from robot_model import InputError

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(inspect)


def inspect(
    recording: Annotated[
        Path,
        typer.Argument(help="the recording (CSV, Parquet, MAT, NPZ, JSON); 'FILE[0:12]' is a part, in s"),
    ],
    map_file: Annotated[
        Path | None, typer.Option("--map", help="mapping file (TOML) that names the columns")
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot", help=f"{ROBOT_HELP}: its limits and dynamics are compared with the recording"
        ),
    ] = None,
    overlay: OverlayOption = None,
    size_limit: SizeLimitOption = LIMIT,
    as_json: Annotated[bool, typer.Option("--json", help="print everything as JSON to stdout")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="only errors and warnings, no notes")] = False,
) -> None:
    """What is in RECORDING: channels, rate, noise; what is wrong with it; what it can and cannot show.

    Exit code 2 when something makes it unusable.
    """
    from missing_physics.api.inspecting import inspect as inspected
    from missing_physics.recordings import load_mapping, own_mapping, sentence_of
    from missing_physics.reporting import PlainConsole
    from missing_physics.reporting.terminal.inspection import print_inspection

    model = open_robot(robot, overlay, quiet=quiet) if robot else None
    mapping = (load_mapping(map_file) if map_file else None) or own_mapping(recording)
    found = inspected(recording, model, map=mapping, size_limit=size_limit * GIGABYTE)
    if quiet:
        kept = [finding for finding in found.content["findings"] if finding["severity"] != "note"]
        found = replace(found, content={**found.content, "findings": kept})
    if as_json:
        sys.stdout.write(json.dumps(found.to_dict(), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    else:
        print_inspection(found.content, PlainConsole())
    for problem in found.problems:
        if problem.severity == "error":
            raise InputError(f"{recording}: {sentence_of(problem, mapping)}")
