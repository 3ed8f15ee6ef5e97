"""The ratios of one run as a table of text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.history.rows import Change, grouped

__all__ = ["ratios"]

MILLI = 1e3
HEADINGS = ("against", "ours [ms]", "theirs [ms]", "ratio", "before")


def ratios(report: Mapping[str, Any], changes: Sequence[Change]) -> str:
    """One line for each peer, by group: both times, and our speed ratio.

    Args:
        report: of pytest-benchmark, the source of the changes.
        changes: of its ratios.
    """
    known = {change.name: change for change in changes}
    lines = []
    for group, own, theirs in grouped(report["benchmarks"]):
        lines.append((f"{group}", "", "", "", ""))
        for peer, seconds in theirs:
            change = known[f"{group}: {peer}"]
            before = "-" if change.before is None else f"{change.before:.3g}"
            times = f"{MILLI * own:.3g}", f"{MILLI * seconds:.3g}"
            lines.append((f"  {peer}", *times, f"{change.now:.3g}", before))
    rows = [HEADINGS, *lines]
    wide = [max(len(row[k]) for row in rows if row[1] or not k) for k in range(len(HEADINGS))]
    return "\n".join(
        (
            row[0].ljust(wide[0])
            + "".join(f"  {cell.rjust(width)}" for cell, width in zip(row[1:], wide[1:]))
        ).rstrip()
        for row in rows
    )
