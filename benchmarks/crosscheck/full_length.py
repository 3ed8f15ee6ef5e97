"""Both engines over the full reference motion of every shipped robot, written as a page of evidence.

    python -m benchmarks.crosscheck.full_length [ROBOT ...]

Runs the same as `missing-physics crosscheck ROBOT`, with its settings, and stores the results in
`reports/crosscheck_full_length/ROBOT`; then writes `reports/evidence/crosscheck_full_length.md` for all
robots with results. With names only those are rerun. Ends with an error if a channel exceeds its band. All
robots take ten minutes of one processor.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import perf_counter, process_time
from typing import Any

from benchmarks.evidence import EVIDENCE, ROOT, commit, head, paragraph, table
from missing_physics.cli.commands.crosscheck import plan_of
from missing_physics.cli.progress import Steps
from missing_physics.reporting.crosscheck import compare, report, write_crosscheck
from robot_model import load_robot, shipped_robots, write_atomically

__all__ = ["main", "page"]

COMMAND = "python -m benchmarks.crosscheck.full_length"
NAME = "crosscheck_full_length"
FOLDER = ROOT / "reports" / NAME
#: Runs, in this order.
RUNS = ("reference", "Exudyn", "reference, coarser", "Exudyn, coarser")

Result = Mapping[str, Any]


class Clock(Steps):
    """Measures the time of every run.

    Attributes:
        seconds: wall and processor time of each, in the order of running.
        notes: other messages.
    """

    def __init__(self, robot: str) -> None:
        super().__init__()
        self._robot = robot
        self.seconds: list[tuple[float, float]] = []
        self.notes: list[str] = []

    @contextmanager
    def step(self, name: str, *, total: float | None = None) -> Iterator[Callable[[float], None]]:
        print(f"{self._robot}: {name}", file=sys.stderr, flush=True)
        wall, own = perf_counter(), process_time()
        yield lambda done: None
        self.seconds.append((perf_counter() - wall, process_time() - own))

    def note(self, text: str) -> None:
        self.notes.append(text)


def main(names: Sequence[str] = ()) -> int:
    """Run, write the page, report channels outside their band."""
    for name in names or shipped_robots():
        found = run(name)
        write_atomically(FOLDER / name / "crosscheck.json", json.dumps(found, indent=1) + "\n")
    every = [
        json.loads(file.read_text())
        for name in shipped_robots()
        if (file := FOLDER / name / "crosscheck.json").exists()
    ]
    write_atomically(EVIDENCE / f"{NAME}.md", page(every))
    outside = [f"{found['robot']}: {name}" for found in every for name in found["outside"] or ()]
    for item in outside:
        print(f"outside its band: {item}", file=sys.stderr)
    return 1 if outside else 0


def run(name: str) -> Result:
    """One robot in both engines, each once more coarser; `comparison.rrd` besides."""
    plan, clock = plan_of(load_robot(name)), Clock(name)
    ours, theirs = plan.reference(clock), plan.exudyn(clock)
    coarser = plan.coarser(clock, ours, theirs)
    comparison = compare(plan.robot, ours, theirs, coarser)
    write_crosscheck(plan.robot, comparison, FOLDER / name / "comparison.rrd")
    return {
        **report(plan.robot, comparison, plan.settings(coarser=bool(coarser))),
        "commit": commit(),
        "seconds": dict(zip(RUNS, clock.seconds)),
        "notes": clock.notes,
    }


def page(every: Sequence[Result]) -> str:
    """The complete page."""
    parts = [
        head("Full-length crosschecks", command=COMMAND),
        paragraph(
            "Every shipped robot over its full reference motion in the reference model and in Exudyn, with",
            "the settings of `missing-physics crosscheck`: bodies and constraints, links by modes, steps of",
            "at most 1 ms, and a coarser run of each engine, whose differences define the band",
            "([docs/crosscheck.md](../../docs/crosscheck.md)). A channel is inside its band if no more than",
            "a thousandth of its samples exceed it. Range: greatest minus least value of the reference; `-`",
            "where a channel does not change beyond rounding or the engines' own errors.",
        ),
        table(
            (
                *("robot", "duration [s]:", "samples:", "channels:", "inside their band:"),
                *("worst channel", "its largest difference over range:"),
            ),
            [_line(found) for found in every],
        ),
        "## Run times",
        paragraph(
            "Wall time [s], and processor time of the process in brackets; the machine is virtual and was",
            "shared.",
        ),
        table(
            ("robot", "Exudyn's step [ms]:", *(f"{name}:" for name in RUNS), "at commit"),
            [_times(found) for found in every],
        ),
    ]
    for found in every:
        parts += [f"## {found['robot']}", found["summary"], *found["notes"], _channels(found)]
    return "\n\n".join(parts) + "\n"


def _line(found: Result) -> list[str]:
    channels, worst = found["channels"], found["worst"]
    inside = sum(bool(item["explained"]) for item in channels.values())
    largest = f"{channels[worst]['max_relative']:.1e}" if worst else "-"
    return [
        *(found["robot"], f"{found['duration']:g}", str(found["samples"]), str(len(channels)), str(inside)),
        *(f"`{worst}`" if worst else "-", largest),
    ]


def _times(found: Result) -> list[str]:
    times = [found["seconds"].get(name) for name in RUNS]
    step = 1e3 * found["engines"]["exudyn"]["step"]
    times_text = [f"{pair[0]:.1f} ({pair[1]:.1f})" if pair else "-" for pair in times]
    return [found["robot"], f"{step:g}", *times_text, found["commit"]]


def _channels(found: Result) -> str:
    rows = []
    for name, item in found["channels"].items():
        relative = [item[key] for key in ("max_relative", "rms_relative")]
        inside = "yes" if item["explained"] else f"{100 * item['inside']:.2f} %"
        rows.append(
            [
                *(f"`{name}`", item["unit"], f"{item['max']:.1e}", f"{item['rms']:.1e}"),
                *("-" if value is None else f"{value:.1e}" for value in relative),
                *(f"{item['bound']:.1e}", inside),
            ]
        )
    headings = ("channel", "unit", "largest:", "rms:", "largest/range:", "rms/range:", "band:", "inside")
    return table(headings, rows)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
