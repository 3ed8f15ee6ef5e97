"""Every real machine diagnosed: `reports/evidence/yardstick.md`.

    python -m benchmarks.yardstick.real [NAME...] [--again] [--label engine-1] [--patience 600]

Settings are the same for all machines. Answers are stored under `reports/yardstick/LABEL/`, so that an
interrupted run can be continued; the page is written from them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from benchmarks.evidence import EVIDENCE, ROOT, command_line
from benchmarks.yardstick.loading import robot_of
from benchmarks.yardstick.machines import machine, rows
from benchmarks.yardstick.page import page
from benchmarks.yardstick.run import PATIENCE, answer, answers_folder
from robot_model import InputError, write_atomically

__all__ = ["main"]

COMMAND = "python -m benchmarks.yardstick.real"


def main(arguments: Sequence[str] | None = None) -> None:
    """Diagnose all or the named machines, and write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Every real machine diagnosed.")
    parser.add_argument("names", nargs="*", help="rows of the table; all when left out")
    parser.add_argument("--again", action="store_true", help="diagnose rows that were answered before, too")
    parser.add_argument("--label", default="now", help="name of the folder that keeps the answers")
    words = "seconds after which a row is given up, and says so"
    parser.add_argument("--patience", type=float, default=PATIENCE, help=words)
    given = parser.parse_args(arguments)
    folder = answers_folder(ROOT, given.label)
    chosen = [machine(name) for name in given.names] or rows()
    robots = [robot_of(row) for row in chosen]
    answers = []
    for row in chosen:
        print(f"{row.name} ...", file=sys.stderr, flush=True)
        answers.append(answer(row, folder, again=given.again, patience=given.patience))
    written = page(command_line(parser, given, ["label", "patience"]), chosen, answers, robots)
    if given.names:
        print(written)
    else:
        write_atomically(EVIDENCE / "yardstick.md", written)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        print(f"{COMMAND}: {error}", file=sys.stderr)
        sys.exit(2)
