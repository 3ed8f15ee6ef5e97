"""Time and memory of the command for one minute of the flexible space robot at 1 kHz.

    python -m benchmarks.speed.long_recording [--seconds 60] [--out FILE]

The recording comes from the reference model and is not part of the measurement. The command is run as a user
runs it, in a separate process, with its report and rerun file.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.evidence import EVIDENCE, head, paragraph, table
from missing_physics.recordings import write_recording
from reference_model.simulation import simulate
from robot_model import MultiSine, Reference, Robot, load_robot, robot_to_toml, write_atomically

__all__ = ["answer_facts", "main", "page", "recorded", "timed"]

COMMAND = "python -m benchmarks.speed.long_recording"
PAGE = EVIDENCE / "long_recording.md"
ROBOT = "flexible_space_robot"
RATE = 1000.0
#: Beginning of the sentence on unsearched effects in the answer.
UNSEARCHED_BEGINS = "Not searched for"
UNSEARCHED = "Not every effect of the catalogue was searched for. The others, in the diagnosis' own words:"
#: Goals: seconds of wall time on two cores, and megabytes.
GOALS = 60.0, 2000.0
#: Reference motion of every joint: amplitudes [rad] and frequencies [Hz], slow enough for the boom's load.
AMPLITUDES, FREQUENCIES, RAMP = (0.1, 0.02), (0.09, 0.23), 3.0


def recorded(folder: Path, seconds: float) -> tuple[str, ...]:
    """Write the nominal robot and its recording into `folder`; returns the labels of the hidden effects."""
    robot = load_robot(ROBOT)
    joints = tuple(
        MultiSine(
            joint=joint.name,
            amplitudes=AMPLITUDES,
            frequencies=tuple(f * (1 + 0.13 * k) for f in FREQUENCIES),
            phases=(0.3 + k, 1.1 - k),
            ramp=RAMP,
        )
        for k, joint in enumerate(robot.moving_joints)
    )
    moved = robot.model_copy(
        update={"reference": Reference(duration=seconds, sample_rate=RATE, joints=joints)}
    )
    write_recording(simulate(moved, seed=1), folder / "recording.csv")
    nominal: Robot = moved.model_copy(update={"effects": ()})
    (folder / "robot.toml").write_text(robot_to_toml(nominal))
    return tuple(f"{use.effect}@{use.at}" for use in robot.effects)


def timed(folder: Path) -> dict[str, Any]:
    """Run the command in `folder`: wall and processor time [s], peak of memory [MB], and its answer."""
    words = [
        sys.executable,
        "-m",
        "missing_physics",
        "diagnose",
        "robot.toml",
        "recording.csv",
        "--out",
        "out",
    ]
    with open(folder / "output.txt", "w") as output:
        began = time.monotonic()
        process = subprocess.Popen(words, cwd=folder, stdout=output, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.monotonic() - began
    if status:
        raise RuntimeError(f"the diagnosis ended with status {status}.")
    answer = json.loads((folder / "out" / "diagnosis.json").read_text())
    return {
        "wall": wall,
        "processor": usage.ru_utime + usage.ru_stime,
        "megabytes": usage.ru_maxrss / 1024.0,
        "summary": (folder / "output.txt").read_text(),
        **answer_facts(answer),
    }


def answer_facts(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Verdict of a `diagnosis.json`, probabilities of named effects, and effects not searched for."""
    return {
        "verdict": answer["verdict"],
        "findings": {
            f"{item['effect']}@{item['location']}": float(item["probability"]) for item in answer["findings"]
        },
        "not_searched": [s for s in answer["could_not_tell"] if s.startswith(UNSEARCHED_BEGINS)],
    }


def _beside(hidden: Sequence[str], named: Mapping[str, float]) -> list[list[str]]:
    """Each hidden or named effect: whether it was hidden, and the probability with which it was named."""
    return [
        [
            f"`{label}`",
            "yes" if label in hidden else "no",
            f"{named[label]:.2f}" if label in named else "not named",
        ]
        for label in dict.fromkeys((*hidden, *named))
    ]


def _with_load(robot: Robot) -> str:
    """A sentence on load-dependent effects; empty if there are none."""
    loaded = [
        f"`{use.effect}@{use.at}` ({', '.join(f'{k} {v:g}' for k, v in loads.items())})"
        for use in robot.effects
        if (loads := {k: v for k, v in use.parameters.items() if k.startswith("load_") and v > 0})
    ]
    if not loaded:
        return ""
    return paragraph(
        f"What was left out as {' and '.join(loaded)} grows with the load of the joint's bearing:",
        "load-dependent friction there is part of what was left out, by another name.",
    )


def page(found: dict[str, Any], hidden: Sequence[str], *, seconds: float, samples: int) -> str:
    """The evidence page."""
    load = f"{os.getloadavg()[0]:.1f}"
    rows = [
        ["wall time [s]", f"{found['wall']:.0f}", f"{GOALS[0]:g}"],
        ["processor time [s]", f"{found['processor']:.0f}", ""],
        ["peak of memory [MB]", f"{found['megabytes']:.0f}", f"{GOALS[1]:g}"],
    ]
    unsearched = [f"- {sentence}" for sentence in found["not_searched"]]
    if unsearched:
        unsearched = [f"{UNSEARCHED}\n\n" + "\n".join(unsearched)]
    return "\n\n".join(
        [
            head("A long recording of the flexible space robot", command=COMMAND),
            paragraph(
                f"{seconds:g} s of `{ROBOT}` at {RATE:g} Hz, {samples} samples, recorded by the reference",
                "model with the effects of its file; the robot that the diagnosis gets has none of them:",
                f"{', '.join(hidden)}. The whole command as a user runs it: reading, the search for effects,",
                "report and rerun file. The machine's load at the end was",
                f"{load} (one-minute mean).",
            ),
            table(["", "measured:", "goal, at most:"], rows),
            *unsearched,
            f"Verdict `{found['verdict']}`. What was left out, and what was named instead or beside it:",
            table(["effect", "left out", "named, with probability:"], _beside(hidden, found["findings"])),
            *filter(None, [_with_load(load_robot(ROBOT))]),
            "```text\n" + found["summary"].rstrip() + "\n```",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Record, time, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        hidden = recorded(Path(name), options.seconds)
        found = timed(Path(name))
    samples = int(np.floor(options.seconds * RATE)) + 1
    text = page(found, hidden, seconds=options.seconds, samples=samples)
    write_atomically(options.out, text.rstrip() + "\n")
    print(f"{found['wall']:.0f} s, {found['megabytes']:.0f} MB: {options.out}")


if __name__ == "__main__":
    main()
