"""Adds a run of `make bench` to the history, and shows it: a table, a page, and a file for the rerun viewer.

    python -m benchmarks.history REPORT [--started SECONDS] [--history FILE] [--html FILE] [--rrd FILE]
        [--strict]

REPORT is what pytest-benchmark writes with `--benchmark-json`.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.history.page import page, peers
from benchmarks.history.rows import appended, changes, read, row_of, write
from benchmarks.history.table import ratios
from benchmarks.history.viewer import write_history
from robot_model import InputError
from robot_model.system.files import write_atomically

__all__ = ["main"]

HISTORY, PAGE = Path("reports/benchmarks_history.json"), Path("reports/benchmarks.html")
VIEWED = Path("reports/benchmarks.rrd")
#: Exit codes.
SOUND, REGRESSED, UNREADABLE = 0, 1, 2


def _report(path: Path) -> Mapping[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"the report '{path}' cannot be read ({error}); run `make bench`.") from None
    if not isinstance(found, dict):
        raise InputError(f"the report '{path}' is not one of pytest-benchmark; run `make bench`.")
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Add a row, write the page, and report slowdowns; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.history", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("report", type=Path)
    parser.add_argument(
        "--started",
        type=float,
        help="when the run began, seconds since 1970 (date +%%s); for how long it took",
    )
    parser.add_argument("--history", type=Path, default=HISTORY)
    parser.add_argument("--html", type=Path, default=PAGE)
    parser.add_argument("--rrd", type=Path, default=VIEWED)
    parser.add_argument(
        "--strict", action="store_true", help=f"exit code {REGRESSED} when something is slower"
    )
    chosen = parser.parse_args(arguments)
    try:
        rows = read(chosen.history)
        report = _report(chosen.report)
        load = report.get("machine_info", {}).get("load", -1.0)
        seconds = -1.0 if chosen.started is None else time.time() - chosen.started
        row = row_of(report, versions=peers(), load=float(load), seconds=seconds)
        if not row.ratios:
            print(f"nothing in {chosen.report} runs beside a peer; the history stays as it is")
            return SOUND
        rows = appended(rows, row)
        write(chosen.history, rows)
        write_atomically(chosen.html, page(rows))
        write_history(rows, chosen.rrd)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return UNREADABLE
    print(ratios(report, changes(rows)))
    slower = [change for change in changes(rows) if change.regressed]
    for change in slower:
        share = change.now / (change.before or 1.0)
        print(f"slower: {change.name}: {change.now:.3g} times as fast, was {change.before:.3g} ({share:.0%})")
    if row.seconds >= 0:
        print(f"the run took {row.seconds:.0f} s")
    print(f"{len(rows)} runs in {chosen.history}; see {chosen.html}, and {chosen.rrd} in the rerun viewer")
    return REGRESSED if slower and chosen.strict else SOUND


if __name__ == "__main__":
    sys.exit(main())
