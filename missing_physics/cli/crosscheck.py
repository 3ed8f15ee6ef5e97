"""`missing-physics crosscheck`: both engines on one robot, friction and control; how far apart."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from robot_model import Recording, Robot, load_robot, unit_of, write_atomically

__all__ = ["register"]

#: Tolerances of the reference run, below what the other engine's step costs.
RTOL, ATOL = 1e-10, 1e-12


class Formulation(StrEnum):
    """How Exudyn describes the robot."""

    redundant = "redundant"
    tree = "tree"


class Flexible(StrEnum):
    """How Exudyn bends flexible links."""

    modal = "modal"
    beam = "beam"


def register(app: typer.Typer) -> None:
    """Add the command to the front door."""
    app.command()(crosscheck)


def crosscheck(
    robot: Annotated[str, typer.Argument(help="A robot file, or the name of a shipped robot.")],
    out: Annotated[
        Path, typer.Option(help="Folder for crosscheck.json and comparison.rrd.", show_default=True)
    ] = Path("crosscheck"),
    step: Annotated[float, typer.Option(help="Largest time step of Exudyn [s].")] = 1e-3,
    formulation: Annotated[
        Formulation,
        typer.Option(
            help="Exudyn's coordinates: bodies with constraints, whose forces load the bearings, or a tree."
        ),
    ] = Formulation.redundant,
    flexible: Annotated[
        Flexible, typer.Option(help="Flexible links in Exudyn: by modes, or as geometrically exact beams.")
    ] = Flexible.modal,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print crosscheck.json instead of the table.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing.")] = False,
) -> None:
    """Run the robot's reference motion in both engines and compare every channel."""
    import exudyn_model
    from missing_physics.reporting.crosscheck import write_crosscheck
    from reference_model.simulation import simulate

    description = load_robot(robot)
    ours = simulate(description, sensors=False, rtol=RTOL, atol=ATOL)
    theirs = exudyn_model.simulate(
        description, sensors=False, step=step, formulation=formulation.value, flexible=flexible.value
    )
    settings = {"step": step, "formulation": formulation.value, "flexible": flexible.value}
    report = _report(description, ours, theirs, settings)
    text = json.dumps(report, indent=1, allow_nan=False) + "\n"
    write_crosscheck(ours, theirs, out / "comparison.rrd")
    write_atomically(out / "crosscheck.json", text)
    if not quiet:
        typer.echo(text if as_json else _table(report), nl=not as_json)


def _report(robot: Robot, ours: Recording, theirs: Recording, settings: dict[str, Any]) -> dict[str, Any]:
    """What crosscheck.json says."""
    from importlib.metadata import version

    from missing_physics.reporting.crosscheck import differences

    prismatic = {joint.name for joint in robot.joints if joint.kind == "prismatic"}
    channels = {
        item.channel: {
            "unit": unit_of(item.channel, prismatic=item.channel.split(".")[0] in prismatic),
            "max": item.largest,
            "rms": item.rms,
            "time_of_max": item.time,
            "range": item.extent,
            "max_relative": item.relative_largest,
            "rms_relative": item.relative_rms,
        }
        for item in differences(ours, theirs)
    }
    return {
        "schema": 1,
        "robot": robot.name,
        "duration": ours.duration,
        "samples": len(ours),
        "engines": {
            "reference": {"rtol": RTOL, "atol": ATOL},
            "exudyn": {"version": version("exudyn"), **settings},
        },
        "channels": channels,
        "only_reference": [name for name in ours if name not in theirs],
        "only_exudyn": [name for name in theirs if name not in ours],
    }


def _table(report: dict[str, Any]) -> str:
    """Differences as text, one line for each channel."""
    channels = report["channels"]
    width = max((len(name) for name in channels), default=0)
    lines = [
        f"{report['robot']}: {report['samples']} samples, {report['duration']:g} s, Exudyn against reference",
        f"{'channel':{width}}  {'unit':8} {'max':>9} {'rms':>9} {'max/range':>9} {'rms/range':>9}",
    ]
    for name, row in channels.items():
        shares = [row["max_relative"], row["rms_relative"]]
        relative = " ".join("        -" if share is None else f"{share:9.1e}" for share in shares)
        lines.append(f"{name:{width}}  {row['unit']:8} {row['max']:9.1e} {row['rms']:9.1e} {relative}")
    for which in ("reference", "exudyn"):
        if missing := report[f"only_{which}"]:
            lines.append(f"only in {which}: {', '.join(missing)}")
    return "\n".join(lines)
