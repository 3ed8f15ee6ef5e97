"""Content of every recording of the yardstick, as one table on stdout.

    python -m benchmarks.yardstick.inspect [NAME...]

The recordings come from the folder `MISSING_PHYSICS_DATA`, or from the cache; a machine without recordings is
reported. Nothing is written.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.yardstick.loading import Loaded, load
from benchmarks.yardstick.machines import Machine, Run, machine, rows
from missing_physics.checks.actuation import actuator_torque
from missing_physics.recordings import check, estimate_noise
from robot_model import InputError, Recording, Robot

__all__ = ["main"]

COMMAND = "python -m benchmarks.yardstick.inspect"
COLUMNS = ("machine", "run", "Hz", "s", "joints", "torque from", "position noise", "torque noise", "warnings")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, for all machines or the named ones."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="What every recording of the yardstick holds.")
    parser.add_argument("names", nargs="*", help="rows of the table; all when left out")
    given = parser.parse_args(arguments)
    lines, absent = [COLUMNS], []
    for row in [machine(name) for name in given.names] or rows():
        try:
            lines += _lines(row, load(row))
        except InputError as error:
            absent.append(str(error))
    widths = [max(map(len, column)) for column in zip(*lines)]
    for line in lines:
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip())
    for sentence in absent:
        print(sentence)


def _lines(row: Machine, loaded: Loaded) -> Iterator[tuple[str, ...]]:
    kinds = ((row.fit, loaded.fit, "fit"), (row.held_out, loaded.held_out, "held out"))
    for runs, recordings, kind in kinds:
        if not runs:
            yield (row.name, f"{kind}: no run", *[""] * (len(COLUMNS) - 2))
        for run, recording in zip(runs, recordings):
            yield _line(row, loaded.robot, run, recording, kind)


def _line(row: Machine, robot: Robot, run: Run, recording: Recording, kind: str) -> tuple[str, ...]:
    joints = row.joints or tuple(joint.name for joint in robot.moving_joints)
    sources = {joint: actuator_torque(robot, recording, joint)[0] for joint in joints}
    driven = [joint for joint, channel in sources.items() if channel]
    kinds = {str(channel).split(".")[1] for channel in sources.values() if channel}
    noise = estimate_noise(recording)
    warnings = sorted(
        {finding.kind for finding in check(recording, robot=robot) if finding.severity != "note"}
    )
    return (
        row.name,
        f"{kind}: {run.label}",
        f"{recording.sample_rate:.0f}",
        f"{recording.duration:.1f}",
        f"{len(driven)} of {len(joints)} driven",
        ", ".join(sorted(kinds)) or "none",
        _span(noise[f"{joint}.position"] for joint in joints),
        _span(noise[str(channel)] for channel in sources.values() if channel),
        ", ".join(warnings),
    )


def _span(values: Iterator[float]) -> str:
    """The smallest and the largest of some numbers."""
    numbers = np.array([value for value in values if np.isfinite(value)])
    if not numbers.size:
        return "-"
    low, high = f"{numbers.min():.2g}", f"{numbers.max():.2g}"
    return low if low == high else f"{low} to {high}"


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"{COMMAND}: {error}")
