"""`missing-physics inspect`: what is in a recording, what is wrong with it, what it can tell."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from missing_physics.cli.console import PlainConsole, styled
from missing_physics.cli.recordings import GIGABYTE, LIMIT, SizeLimitOption
from missing_physics.cli.robots import ROBOT_HELP, OverlayOption, open_robot
from missing_physics.diagnosis import (
    Coverage,
    contradictions,
    coverage,
    one_way_words,
    prepared,
    reason_words,
)
from missing_physics.recordings import (
    Finding,
    check,
    estimate_noise,
    estimate_resolution,
    excitation,
    load_mapping,
    load_recording_and_constants,
    mended_map,
    outlook,
    own_mapping,
    told,
)
from robot_model import InputError, Recording, Robot, unit_of

__all__ = ["register", "report"]

#: Kinds of findings that the motion alone gives without a robot.
MOTION = ("no_motion", "one_direction", "no_torque", "torque_constant", "left_out")
#: Whatever a table needs, but not without end [characters].
WIDEST = 1000
_STYLES = {"error": "bold red", "warning": "yellow", "note": "dim"}


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(inspect)


def inspect(
    recording: Annotated[
        Path,
        typer.Argument(help="the recording (CSV, Parquet, MAT, NPZ, JSON); FILE@0:12 is a part, in seconds"),
    ],
    map_file: Annotated[
        Path | None, typer.Option("--map", help="mapping file (TOML) that names the columns")
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option("--robot", help=f"{ROBOT_HELP}: its limits and its dynamics are weighed"),
    ] = None,
    overlay: OverlayOption = None,
    size_limit: SizeLimitOption = LIMIT,
    as_json: Annotated[bool, typer.Option("--json", help="print everything as JSON to stdout")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="only errors and warnings, no notes")] = False,
) -> None:
    """What is in RECORDING: channels, rate, noise; what is wrong with it; what it can and cannot tell.

    Exit code 2 when something makes it unusable.
    """
    mapping = load_mapping(map_file) if map_file else own_mapping(recording)
    model = open_robot(robot, overlay, quiet=quiet) if robot else None
    data, constants = load_recording_and_constants(
        recording, mapping=mapping, size_limit=size_limit * GIGABYTE
    )
    sliding = {joint.name for joint in model.joints if joint.kind == "prismatic"} if model else set()
    findings, covered = _findings(data, model)
    prismatic = sliding.union(mapping.prismatic if mapping else ())
    content = report(data, prismatic=prismatic, covered=covered)
    content["findings"] = [asdict(f) for f in findings if not (quiet and f.severity == "note")]
    mends = [mend for finding in findings for mend in finding.mends]
    content["map"] = mended_map(data, mends, mapping) if mends else ""
    content["constants"] = constants
    if as_json:
        sys.stdout.write(json.dumps(_plain(content), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    else:
        _print(content, PlainConsole())
    for finding in findings:
        if finding.severity == "error":
            raise InputError(f"{recording}: {told(finding, mapping)}")


def _findings(data: Recording, model: Robot | None) -> tuple[tuple[Finding, ...], Coverage | None]:
    """What the checks see; with a robot, and nothing wrong without one, what a diagnosis would say first."""
    found = check(data, robot=model)
    if model is None or any(finding.severity == "error" for finding in found):
        return found, None
    try:
        ready = prepared(model, [data])
    except InputError as error:  # what a diagnosis needs is not all there
        stops = Finding("warning", "robot", "time", f"a diagnosis with this robot stops: {error}")
        return (*found, stops), None
    covered = coverage(model, ready.recordings, ready.dynamics, fitted=1, dead=ready.dead)
    # with a robot the motion is judged as a diagnosis does it
    said = {("dead", channel) for channel in ready.dead}
    others = (f for f in found if f.kind not in MOTION and (f.kind, f.channel) not in said)
    wrong = contradictions(model, ready.recordings[0], ready.dynamics[0])
    return (*wrong, *_lacking(covered), *others), covered


def _lacking(covered: Coverage) -> Iterator[Finding]:
    """What a diagnosis could not tell, as findings."""
    for sentence in covered.general:
        yield Finding("warning", "left_out", "time", sentence)
    for reason, joints in covered.not_judged.items():
        yield Finding("warning", reason.kind, f"{joints[0]}.position", reason_words(reason, joints))
    if one_way := covered.one_way:
        yield Finding("warning", "one_direction", f"{one_way[0]}.position", one_way_words(one_way))
    if not covered.enough:
        yield Finding("warning", "not_enough", "time", "a diagnosis with this robot ends as not_enough_data.")


def report(
    recording: Recording,
    *,
    prismatic: set[str] | frozenset[str] = frozenset(),
    covered: Coverage | None = None,
) -> dict[str, Any]:
    """Channels, motion and outlook of a recording as plain data.

    Args:
        recording: what was read.
        prismatic: joints whose positions are lengths.
        covered: what a diagnosis with a robot can judge, where one is given.
    """
    noise, resolution = estimate_noise(recording), estimate_resolution(recording)
    can, cannot = outlook(recording, not_judged=_not_judged(covered))
    return {
        "source": recording.source,
        "samples": len(recording),
        "duration_s": recording.duration,
        "sample_rate_hz": recording.sample_rate,
        "channels": [
            {
                "name": name,
                "unit": unit_of(name, prismatic=name.split(".")[0] in prismatic),
                "smallest": float(np.nanmin(values)),
                "largest": float(np.nanmax(values)),
                "rms": float(np.sqrt(np.nanmean(values**2))),
                "missing": int(np.isnan(values).sum()),
                "noise": noise[name],
                "resolution": resolution.get(name),
            }
            for name, values in recording.channels.items()
        ],
        "motion": [asdict(move) for move in excitation(recording)],
        "can_tell": list(can),
        "cannot_tell": list(cannot),
    }


def _not_judged(covered: Coverage | None) -> dict[str, str]:
    """Joint to the sentence that says why nothing can be judged of it."""
    reasons = {} if covered is None else covered.not_judged
    return {name: reason_words(reason, names) for reason, names in reasons.items() for name in names}


def _print(content: dict[str, Any], console: PlainConsole) -> None:
    console.print(content["source"], style="bold", soft_wrap=True)
    console.print(
        f"{content['samples']} samples over {content['duration_s']:.6g} s, {content['sample_rate_hz']:.6g} Hz"
    )
    if content["constants"]:
        constants = [f"{name} = {value:.6g}" for name, value in content["constants"].items()]
        console.print("constants of the file: " + ", ".join(constants), soft_wrap=True)
    console.print()
    _print_whole(_channels(content["channels"]), console)
    if content["motion"]:
        console.print()
        _print_whole(_motion(content["motion"]), console)
    console.print()
    if not content["findings"]:
        console.print("No problems found.")
    for finding in content["findings"]:
        severity = f"{finding['severity']:8}", _STYLES[finding["severity"]]
        console.print(styled(severity, f" {finding['sentence']}"), soft_wrap=True)
    if content["map"]:
        console.print("\nMap that corrects it", style="bold")
        console.print(content["map"], soft_wrap=True)
    for title, key, sign in (("It can tell", "can_tell", "+"), ("It cannot tell", "cannot_tell", "-")):
        console.print(f"\n{title}", style="bold")
        for sentence in content[key]:
            console.print(f" {sign} {sentence}", soft_wrap=True)


def _print_whole(table: Table, console: PlainConsole) -> None:
    """A table with all names and numbers, whose lines a narrower terminal breaks."""
    table.width = console.measure(table, options=console.options.update(width=WIDEST)).maximum
    console.print(table, soft_wrap=True)


def _channels(channels: list[dict[str, Any]]) -> Table:
    table = Table(box=None)
    for title in ("channel", "unit"):
        table.add_column(title, no_wrap=True)
    for title in ("smallest", "largest", "noise", "step", "missing"):
        table.add_column(title, justify="right")
    for row in channels:
        numbers = [row[key] for key in ("smallest", "largest", "noise", "resolution")]
        cells = ["-" if x is None or math.isnan(x) else f"{x:.4g}" for x in numbers]
        table.add_row(row["name"], row["unit"], *cells, str(row["missing"] or "-"))
    return table


def _motion(moves: list[dict[str, Any]]) -> Table:
    table = Table(box=None)
    table.add_column("motion of")
    for title in ("range", "top speed", "rms acc.", "reversals", "at rest", "+/-", "speeds", "band"):
        table.add_column(title, justify="right")
    for move in moves:
        table.add_row(
            move["place"],
            f"{move['position_range']:.4g}",
            f"{move['max_speed']:.4g}",
            f"{move['rms_acceleration']:.4g}",
            str(move["reversals"]),
            f"{100 * move['at_rest']:.0f} %",
            f"{100 * move['forward']:.0f}/{100 * move['backward']:.0f} %",
            f"{move['speed_levels']}/10",
            f"{move['bandwidth_hz']:.3g} Hz",
        )
    return table


def _plain(value: Any) -> Any:
    """Plain JSON values; what is not a finite number becomes null."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
