"""Spectra of residuals, calibration of the score and coverage of intervals: `reports/evidence/likelihood.md`.

python -m benchmarks.yardstick.likelihood [--machines NAME...] [--fits 400] [--processes 1] [--out FILE]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.evidence import EVIDENCE, command_line
from benchmarks.yardstick.likelihood.fits import drifting_fit_of, fit_of
from benchmarks.yardstick.likelihood.page import page
from benchmarks.yardstick.likelihood.processes import each
from benchmarks.yardstick.likelihood.recorded import measured
from benchmarks.yardstick.machines import machine, rows
from missing_physics.recordings.datasets import find_dataset
from robot_model import InputError, write_atomically

__all__ = ["main"]

COMMAND = "python -m benchmarks.yardstick.likelihood"
PAGE = EVIDENCE / "likelihood.md"


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure machines and simulated fits, and write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description=__doc__.splitlines()[0])
    words = "rows of the yardstick; all whose recordings are here when left out"
    parser.add_argument("--machines", nargs="*", metavar="NAME", help=words)
    parser.add_argument(
        "--fits", type=int, default=400, help="simulated fits; half as many with torques that drift"
    )
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--out", type=Path, default=PAGE)
    given = parser.parse_args(arguments)
    if given.machines is None:
        names = [row.name for row in rows() if find_dataset(row.dataset) is not None]
    else:
        names = [machine(name).name for name in given.machines]
    made = (
        each(measured, names, given.processes),
        each(fit_of, range(given.fits), given.processes),
        each(drifting_fit_of, range(given.fits // 2), given.processes),
    )
    write_atomically(given.out, page(command_line(parser, given, ["fits"]), *made))


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        print(f"{COMMAND}: {error}", file=sys.stderr)
        sys.exit(2)
