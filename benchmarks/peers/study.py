"""Other tools on the same recordings as the diagnosis, as one page of evidence.

    python -m benchmarks.peers.study [--out FILE] [--only emps,servo,arm,axis]

The peers come with the extra `peers`. Real recordings come from the folder that `MISSING_PHYSICS_DATA` names,
or are downloaded; simulated ones are made anew. With `--only` the page goes to `reports/`, which git ignores,
unless `--out` says otherwise.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.evidence import EVIDENCE, bullets, head, number, percent, table
from benchmarks.peers import tools as peer_tools
from benchmarks.peers.cases import CASES, MOVING, Case, load_case
from benchmarks.peers.sysid import ITERATIONS, WINDOW, mujoco_sysid
from benchmarks.peers.tools import THRESHOLDS, Answer
from missing_physics.challenge.scoring.baselines import REGRESSORS
from robot_model import InputError, nearest, write_atomically

__all__ = ["main"]

COMMAND = "python -m benchmarks.peers.study"
PAGE = EVIDENCE / "peers.md"
PART = EVIDENCE.parent / "peers_part.md"
PACKAGES = ("mujoco", "pysindy")


@dataclass(frozen=True)
class Tool:
    """A tool, its settings, and its limitations by design."""

    title: str
    run: Callable[[Case], Answer]
    setting: str
    cannot: str


TOOLS: tuple[Tool, ...] = (
    Tool("nominal robot, unchanged", peer_tools.nominal, "nothing is fitted", "-"),
    Tool(
        "nominal robot, refitted",
        peer_tools.refitted,
        "inertial numbers and the parameters of the effects that the robot file has, by least squares",
        "names nothing: missing physics biases the existing parameters",
    ),
    Tool(
        "IDIM-LS with fixed friction",
        peer_tools.idim,
        "inertial numbers, viscous and Coulomb friction and an offset in every joint, by least squares of "
        "the torque (inverse dynamic identification)",
        "does not test whether these terms are needed or sufficient; no intervals valid for correlated "
        "errors",
    ),
    Tool(
        "PySINDy (STLSQ)",
        peer_tools.sparse,
        f"residual torque of the nominal robot, joint by joint, on {len(REGRESSORS)} regressors "
        f"({', '.join(REGRESSORS)}), columns and target of unit size; the threshold of "
        f"{', '.join(map(str, THRESHOLDS))} that is best on the last quarter of the fitted data. The "
        "measured torque is no regressor, since it is what is to be predicted",
        "terms are linear in their coefficients, so that shapes (a Stribeck velocity, a ripple's period) are "
        "fixed beforehand; no place but the joint, no intervals, no held-out proof, no rivals",
    ),
    Tool(
        "mujoco.sysid",
        mujoco_sysid,
        "its `optimize` with the `mujoco` optimiser and scaling by the Jacobian, at most "
        f"{ITERATIONS} iterations; masses (or rotor, where masses are known), `damping`, `frictionloss` "
        f"and a motor offset in every joint; windows of {WINDOW:g} s from the estimated state, under the "
        "recorded torque or voltage, residual in the joints' positions, one thread. Bounds and starts are in "
        "`benchmarks/peers/sysid.py`; other starts ended in the same place where that was tried",
        "fits the given parameters, and only those that MuJoCo's model has; names nothing and has no "
        "held-out proof; its intervals assume white errors",
    ),
    Tool(
        "missing-physics diagnose",
        peer_tools.diagnosis,
        "defaults, no validation recording, no separating motions; the augmented robot file predicts",
        "-",
    ),
)
INTRODUCTION = f"""\
Each tool gets the same nominal robot and the same fitted recordings, and the held-out recordings are shown to
none. **Error**: whatever a tool found is put into the torque that it predicts along the held-out motion; rms
of measured minus predicted torque over rms of measured torque, both through the same filter, where the joint
moves at more than {100 * MOVING:g} % of its largest speed: what static friction holds at rest no tool
predicts. The motion is estimated once for all of them, by the usual recipe (zero-phase Butterworth filter,
spline, decimation) and not by the diagnosis, which estimates its own for its fits; no tool's prediction
sees the measured torque. Of the servo a voltage is recorded; there the error is that of the voltage, given as
the torque of the nominal motor. **Time**: processor seconds of this process in this run, after everything is
read and imported. mujoco.sysid fits positions of free runs and is measured by torque all the same; least
squares and the sparse regression fit what is measured here. The tools are not made for the same job: what is
a peer's and what is not is in the last column of the first table. EMPS and the servo are real; nobody knows
the truth there, and published values come from fits with a chosen structure. Seeds of the simulated
recordings are development seeds."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run every tool on every case, and write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Other tools on the same recordings.")
    parser.add_argument("--out", type=Path, help="Markdown file to write")
    parser.add_argument("--only", help=f"some of {','.join(CASES)}, with commas between")
    given = parser.parse_args(arguments)
    chosen = given.only.split(",") if given.only else list(CASES)
    for name in chosen:
        if name not in CASES:
            raise InputError(f"there is no case '{name}'{nearest(name, CASES)}.")
    out = given.out or (PART if given.only else PAGE)
    write_atomically(out, page(chosen, command=COMMAND + (f" --only {given.only}" if given.only else "")))
    print(out)


def page(names: Sequence[str], *, command: str) -> str:
    """The page, in Markdown."""
    tools = [[tool.title, tool.setting, tool.cannot] for tool in TOOLS]
    parts = [
        head("Other tools on the same recordings", command=command),
        f"Peers: {', '.join(f'{name} {_version(name)}' for name in PACKAGES)}.",
        INTRODUCTION,
        "## The tools and their settings",
        table(["tool", "setting", "what it does not do"], tools),
    ]
    for name in names:
        parts += _section(load_case(name))
    return "\n\n".join(parts) + "\n"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _section(case: Case) -> Iterator[str]:
    for motion in (*case.motions, *case.held_out_motions):  # estimated once, before the clock runs
        motion.along.regressor, motion.along.nominal(), motion.torque
    rows, notes = [], []
    for tool in TOOLS:
        with threadpool_limits(limits=1):
            began = time.process_time()
            answer = tool.run(case)
            seconds = time.process_time() - began
        print(f"{case.title}: {tool.title}, {seconds:.1f} s", file=sys.stderr)
        shown = f"{seconds:.2g}" if answer.predicted else "-"
        rows.append([tool.title, *_errors(case, answer), shown, _found(answer.found, case.known)])
        if answer.note:
            notes.append(f"{tool.title}: {answer.note}")
    joints = case.motions[0].joints
    errors = ["error:"] if len(joints) == 1 else [f"error at {joint}:" for joint in joints]
    known = "; ".join(f"`{label}` {number(value)}" for label, value in case.known.items())
    yield f"## {case.title}"
    yield f"{case.origin}. Common filter: {case.cutoff:g} Hz. {case.truth.capitalize()}: {known}."
    if case.hidden:
        yield f"Beyond what the other tools can say here: {case.hidden}."
    yield table(["tool", *errors, "time [s]:", f"found ({case.truth} in brackets)"], rows)
    yield bullets(notes)


def _errors(case: Case, answer: Answer) -> list[str]:
    """Relative held-out error of each joint."""
    motions = case.held_out_motions
    if not answer.predicted:
        return ["-"] * len(motions[0].joints)
    moves = np.concatenate([m.moves for m in motions])
    left = np.concatenate([m.reduced(m.torque - p) for m, p in zip(motions, answer.predicted)])
    measured = np.concatenate([m.reduced(m.torque) for m in motions])
    energy, whole = (np.sum(moves * values**2, axis=0) for values in (left, measured))
    return [percent(e) for e in np.sqrt(energy / whole)]


def _found(found: Mapping[str, tuple[float, float | None]], known: Mapping[str, float]) -> str:
    words = []
    for label, (value, half) in found.items():
        interval = "" if half is None else f" ± {half:.2g}"
        beside = f" ({number(known[label])})" if label in known else ""
        words.append(f"{label} {number(value)}{interval}{beside}")
    return "; ".join(words) or "-"


if __name__ == "__main__":
    main()
