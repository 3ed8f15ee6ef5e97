"""The standard model by a Kalman filter and by rows in a band: `reports/evidence/kalman.md`.

python -m benchmarks.yardstick.kalman [--machines NAME...] [--arms 24] [--processes 1] [--out FILE]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.evidence import EVIDENCE, command_line
from benchmarks.yardstick.kalman.compared import arm_errors, compared
from benchmarks.yardstick.kalman.page import page
from benchmarks.yardstick.likelihood.fits import DRIFT
from benchmarks.yardstick.likelihood.processes import each
from benchmarks.yardstick.machines import machine, rows
from missing_physics.recordings.datasets import find_dataset
from robot_model import InputError, write_atomically

__all__ = ["main"]

COMMAND = "python -m benchmarks.yardstick.kalman"
PAGE = EVIDENCE / "kalman.md"


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare the estimators at machines and simulated arms, and write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description=__doc__.splitlines()[0])
    words = "rows of the yardstick; all whose recordings are here when left out"
    parser.add_argument("--machines", nargs="*", metavar="NAME", help=words)
    parser.add_argument("--arms", type=int, default=24, help="simulated arms without a further effect")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--out", type=Path, default=PAGE)
    given = parser.parse_args(arguments)
    if given.machines is None:
        names = [row.name for row in rows() if find_dataset(row.dataset) is not None]
    else:
        names = [machine(name).name for name in given.machines]
    arms = [(number, drift) for drift in (0.0, DRIFT) for number in range(given.arms)]
    made = each(compared, names, given.processes), each(arm_errors, arms, given.processes)
    write_atomically(given.out, page(command_line(parser, given, ["arms"]), *made))


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        print(f"{COMMAND}: {error}", file=sys.stderr)
        sys.exit(2)
