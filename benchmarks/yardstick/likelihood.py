"""Whether the likelihood can be believed: the standard model by it and by weighted least squares.

    python -m benchmarks.yardstick.likelihood [NAME...]

Writes `reports/evidence/likelihood.md`, or prints the rows that are named. On every machine of the
yardstick both fits should agree within both their 95 % intervals; the page marks where they do not.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.evidence import EVIDENCE, head, number, table
from benchmarks.yardstick.loading import load
from benchmarks.yardstick.machines import Machine, machine, rows
from missing_physics.inference.standard_hypothesis import StandardHypothesis, fit_standard_hypothesis
from missing_physics.standard import StandardModel, fit_standard
from missing_physics.standard.rows import FRICTION
from robot_model import InputError

__all__ = ["main"]

COMMAND = "python -m benchmarks.yardstick.likelihood"
#: Half of a 95 % interval [standard deviations].
INTERVAL = 1.96


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit every machine, or those that are named."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="The standard model by two fits.")
    parser.add_argument("names", nargs="*", help="rows of the table; all when left out")
    given = parser.parse_args(arguments)
    found, notes = [], []
    for row in [machine(name) for name in given.names] or rows():
        print(f"{row.name} ...", file=sys.stderr, flush=True)
        try:
            found += list(_lines(row))
        except InputError as error:
            notes.append(f"- {row.name}: {error}")
    page = "\n\n".join(_page(found, notes)) + "\n"
    if given.names:
        print(page)
    else:
        (EVIDENCE / "likelihood.md").write_text(page, "utf-8")


def _page(lines: Sequence[tuple[str, ...]], notes: Sequence[str]) -> Iterator[str]:
    yield head("The standard model by its likelihood", command=COMMAND)
    apart = sum("*" in "".join(line) for line in lines)
    yield (
        "Each cell is the estimate by the likelihood, its standard deviation, and in brackets the same by "
        "weighted least squares in the band of the motion. A star marks numbers whose 95 % intervals do not "
        f"overlap: {apart} of {len(lines)} joints have one. `timing` is how much later than the recorded "
        "torque the motion answers, in samples; `bodies` and `laws` are the frequencies above which rigid "
        "bodies and laws of friction were found not to hold."
    )
    headings = ("machine", "joint", *FRICTION, "timing", "bodies, laws [Hz]:", "seconds:")
    yield table(headings, lines)
    if notes:
        yield "Not fitted:"
        yield "\n".join(notes)


def _lines(row: Machine) -> Iterator[tuple[str, ...]]:
    loaded = load(row)
    start = fit_standard(loaded.robot, loaded.fit)
    began = time.process_time()
    fit = fit_standard_hypothesis(start, loaded.fit)
    seconds = time.process_time() - began
    for name, joint in fit.joints.items():
        cells = [_cell(start, fit, name, kind) for kind in FRICTION]
        late, spread = (value / fit.step for value in fit.timing)
        corners = f"{joint.error.bodies:.3g}, {joint.error.laws:.3g}"
        yield (row.name, name, *cells, f"{late:.2f} ± {spread:.2f}", corners, f"{seconds:.1f}")


def _cell(start: StandardModel, fit: StandardHypothesis, name: str, kind: str) -> str:
    value, spread = fit.joints[name].estimates[kind]
    other, width = start.estimate.value(f"{name}.{kind}")
    apart = abs(value - other) > INTERVAL * (spread + width)
    text = f"{number(value)} ± {spread:.1g} ({number(other)} ± {width:.1g})"
    return f"{text} *" if apart and np.isfinite(value) else text


if __name__ == "__main__":
    main()
