"""`missing-physics diagnose`: the main command."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from missing_physics.api.diagnosing import with_doubts
from missing_physics.api.thinning import thinned
from missing_physics.checks.transmissions import on_both_sides
from missing_physics.cli.progress import phases
from missing_physics.cli.recordings import GIGABYTE, LIMIT, SizeLimitOption
from missing_physics.cli.robots import ROBOT_HELP, OverlayOption, open_robot
from missing_physics.diagnosis import ContradictionError, Options
from missing_physics.diagnosis import diagnose as run_diagnosis
from missing_physics.premises import require_premises
from missing_physics.recordings import load_mapping, load_recording
from missing_physics.reporting import print_summary, write_outputs
from missing_physics.reporting.terminal.console import PlainConsole
from robot_model import Recording, require_folder

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(diagnose)


def diagnose(
    robot: Annotated[str, typer.Argument(help=ROBOT_HELP)],
    recordings: Annotated[
        list[Path],
        typer.Argument(
            help="recordings to fit (CSV, Parquet, MAT, NPZ, JSON); 'FILE[0:12]' is a part, in seconds"
        ),
    ],
    validate: Annotated[
        list[Path] | None,
        typer.Option("--validate", help="recording that is only predicted, never fitted; may be repeated"),
    ] = None,
    overlay: OverlayOption = None,
    out: Annotated[Path, typer.Option("--out", help="folder for the results")] = Path("diagnosis"),
    map_file: Annotated[
        Path | None, typer.Option("--map", help="mapping file (TOML) that names the columns")
    ] = None,
    cutoff: Annotated[
        float | None,
        typer.Option(help="cut-off of the low-pass filter in Hz; by default chosen from the data"),
    ] = None,
    as_recorded: Annotated[
        bool,
        typer.Option("--as-recorded", help="continue although channels contradict each other or the motion"),
    ] = False,
    size_limit: SizeLimitOption = LIMIT,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate",
            metavar="HZ",
            help="decimate to this sample rate, behind an anti-alias filter; by default, only recordings "
            "with too many samples are decimated",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="seed of all random numbers")] = 0,
    as_json: Annotated[
        bool, typer.Option("--json", help="print diagnosis.json to stdout instead of the summary")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="no progress on stderr")] = False,
) -> None:
    """Locate, name, model and prove the physics that ROBOT leaves out of RECORDING...

    Writes diagnosis.json, report.html, comparison.rrd and robot.augmented.toml into the folder of --out.
    Where channels contradict each other or the motion it stops and says how to correct them (exit code 2).
    """
    require_folder(out)
    nominal = open_robot(robot, overlay, quiet=quiet)
    mapping = load_mapping(map_file) if map_file else None
    options = Options(cutoff=cutoff, seed=seed, as_recorded=as_recorded)

    def say(sentence: str) -> None:
        if not quiet:
            typer.echo(sentence, err=True)

    with phases(quiet=quiet) as show:

        def read(path: Path) -> Recording:
            show(f"reading {path}")
            return load_recording(
                path,
                mapping=mapping,
                check=not as_recorded,
                robot=nominal,
                size_limit=size_limit * GIGABYTE,
            )

        fitted, scored = ([read(path) for path in paths] for paths in (recordings, validate or ()))
        show("checking the premises")
        every = thinned(nominal, (*fitted, *scored), rate=rate, tell=say)
        every = [on_both_sides(nominal, one) for one in every]
        fitted, scored = every[: len(fitted)], every[len(fitted) :]
        doubts = require_premises(nominal, every, mapping, as_recorded=as_recorded)
        for doubt in doubts:
            say(f"{doubt.severity}: {doubt.sentence}.")
        try:
            result = run_diagnosis(nominal, fitted, scored, options=options, progress=show)
        except ContradictionError as found:
            raise ContradictionError(found.recording, found.findings, mapping) from None
        result = with_doubts(result, doubts)
        show("writing the report")
        write_outputs(result, nominal, out, recordings=every)
    if as_json:
        sys.stdout.write(result.diagnosis.to_json())
    else:
        print_summary(result, PlainConsole())
        print(f"\nReport: {out / 'report.html'}   Comparison: missing-physics view {out}")
