"""`missing-physics challenge`: the blind proof."""

from __future__ import annotations

import datetime
import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from missing_physics.cli.progress import phases
from robot_model import replacing_set, require_folder, write_atomically

if TYPE_CHECKING:
    from missing_physics.challenge import Report

__all__ = ["register"]

#: Default number of the first case of a challenge: one for development.
DEFAULT_SEED = 10000
DEFAULT_CASES = 25
#: Packages whose versions affect the results.
PACKAGES = ("exudyn", "casadi", "numpy", "scipy", "missing-physics")
#: Message after an interrupt.
AGAIN = "What is finished is kept; the same command goes on from there."


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(challenge)


def challenge(
    cases: Annotated[int, typer.Option(min=1, help="how many cases")] = DEFAULT_CASES,
    seed: Annotated[
        int,
        typer.Option(
            min=0,
            help="number of the first case; each case is drawn from its number alone. 10000 to 19999 are for "
            "development, 50000 to 50299 for the yardstick, the others from 20000 to 99999 for scoring",
        ),
    ] = DEFAULT_SEED,
    out: Annotated[Path, typer.Option("--out", help="folder of the challenge")] = Path("reports/challenge"),
    scheduler: Annotated[
        str, typer.Option(help="address of a dask scheduler; left out, a local cluster does it")
    ] = "",
    workers: Annotated[int, typer.Option(min=0, help="processes at a time; 0 for one per core")] = 0,
    evidence: Annotated[Path | None, typer.Option(help="write the page in Markdown here too")] = None,
    show: Annotated[
        int | None,
        typer.Option(help="of a finished challenge, diagnose this case again, with report and comparison"),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="no progress on stderr")] = False,
) -> None:
    """Conceal physics in simulated robots, seal the truth, diagnose blindly, open, score.

    Writes report.html and report.md into the folder of --out, with everything they are made of. A run that
    was interrupted goes on where it stopped when it is started again.
    """
    from missing_physics.challenge import Settings, run
    from missing_physics.challenge import show as shown

    if show is not None:
        folder = shown(out, show)
        print(f"Case {show}: {folder / 'report.html'}   Comparison: missing-physics view {folder}")
        return
    require_folder(out)
    if evidence is not None:
        require_folder(evidence.parent)
    with phases(quiet=quiet, measured=True) as tell:
        settings = Settings(
            seed=seed,
            cases=cases,
            folder=out,
            workers=workers,
            scheduler=scheduler,
            tell=tell,
            say=lambda sentence: print(sentence, flush=True),
        )
        try:
            report = run(settings)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(AGAIN) from None
    command = f"missing-physics challenge --cases {cases} --seed {seed}"
    _write(report, out, evidence, command)


def _write(report: Report, out: Path, evidence: Path | None, command: str) -> None:
    from missing_physics.challenge.page import interval, markdown
    from missing_physics.challenge.scoring.summary import summary_of
    from missing_physics.reporting.pages.challenge_report import write_challenge

    page = markdown(report, command=command, environment=_environment())
    with replacing_set(out) as fresh:
        write_atomically(fresh / "report.md", page)
        write_challenge(report, fresh / "report.html")
    if evidence is not None:
        write_atomically(evidence, page)
    found = summary_of(report)
    for goal in found.goals:
        print(f"{goal.name}: {interval(goal.share)}  {goal.verdict}")
    print(f"{len(found.failures)} of {len(report.scores)} cases failed. Report: {out / 'report.html'}")


def _environment() -> str:
    versions = ", ".join([f"Python {platform.python_version()}", *(f"{n} {version(n)}" for n in PACKAGES)])
    machine = f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"
    return f"{datetime.date.today().isoformat()}; {versions}; {machine}."
