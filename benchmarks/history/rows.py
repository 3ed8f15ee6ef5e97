"""The history of `make bench`: rows of ratios to the peers of the same run, and slowdowns.

A row stores the ratio of every peer's time to ours, and nothing is judged by absolute times: another or a
busy machine changes both. The file is not in git (`reports/` is ignored): a ratio still depends on the
machine, whose type each row names, and rows are compared only for the same type and the same version of the
peer. A report without a peer, of a part of the benchmarks, adds no row.
"""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from robot_model import InputError
from robot_model.system.files import write_atomically

__all__ = [
    "ALLOWED",
    "ENOUGH",
    "WINDOW",
    "Change",
    "Row",
    "appended",
    "changes",
    "grouped",
    "read",
    "row_of",
    "write",
]

VERSION = 1
#: A ratio below this fraction of the earlier one is a regression. Ratios of single runs on a shared machine
#: scatter by some ten percent.
ALLOWED = 0.75
#: Number of earlier rows whose median is the baseline, and the least number needed.
WINDOW, ENOUGH = 10, 3


@dataclass(frozen=True)
class Row:
    """One run of the benchmarks.

    Attributes:
        time: when, ISO 8601.
        commit: of the program; empty if unknown.
        machine: its kind.
        load: of the machine in the minute before, processes; negative if unknown.
        versions: of the peers.
        ratios: "GROUP: PEER" to the peer's time over ours.
        seconds: total wall time of the run; negative if unknown.
    """

    time: str
    commit: str
    machine: str
    load: float
    versions: Mapping[str, str]
    ratios: Mapping[str, float]
    seconds: float = -1.0


@dataclass(frozen=True)
class Change:
    """A ratio and its earlier value.

    Attributes:
        name: of the ratio.
        now: in the last row.
        before: median of earlier ones; None where there are too few.
    """

    name: str
    now: float
    before: float | None

    @property
    def regressed(self) -> bool:
        """Whether we have become slower relative to this peer."""
        return self.before is not None and self.now < ALLOWED * self.before


def row_of(
    report: Mapping[str, Any], *, versions: Mapping[str, str], load: float, seconds: float = -1.0
) -> Row:
    """The row of one report of pytest-benchmark.

    Of every group, the benchmark with `extra_info` "ours" is compared with all that name a "peer"; both give
    "seconds".

    Raises:
        InputError: it is not such a report.
    """
    try:
        found = _ratios(report["benchmarks"])
        machine, commit = report["machine_info"], report["commit_info"].get("id") or ""
        kind = f"{machine['system']} {machine['machine']}, {machine['cpu'].get('brand_raw', 'unknown')}"
        time = str(report["datetime"])
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"the report is not one of pytest-benchmark: {error!r} is wrong in it.") from None
    return Row(time, str(commit)[:12], kind, load, dict(versions), found, seconds)


def _ratios(benchmarks: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    return {
        f"{name}: {peer}": seconds / own
        for name, own, theirs in grouped(benchmarks)
        for peer, seconds in theirs
    }


def grouped(
    benchmarks: Sequence[Mapping[str, Any]],
) -> list[tuple[str, float, list[tuple[str, float]]]]:
    """For every group with peers: its name, our time, and the peers with theirs [s]."""
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for one in benchmarks:
        groups.setdefault(one["group"] or "", []).append(one["extra_info"])
    found = []
    for name, members in sorted(groups.items()):
        own = [info["seconds"] for info in members if info.get("ours") and "seconds" in info]
        theirs = [
            (str(info["peer"]), float(info["seconds"]))
            for info in members
            if "peer" in info and info.get("seconds", 0) > 0
        ]
        if len(own) == 1 and theirs:
            found.append((name, float(own[0]), theirs))
    return found


def appended(rows: Sequence[Row], row: Row) -> tuple[Row, ...]:
    """The rows with this one at the end; it replaces one of the same time."""
    return (*(other for other in rows if other.time != row.time), row)


def changes(rows: Sequence[Row]) -> tuple[Change, ...]:
    """The last row's ratios and the median of earlier comparable ones."""
    if not rows:
        return ()
    last = rows[-1]
    found = []
    for name, now in last.ratios.items():
        before = [
            row.ratios[name] for row in rows[:-1] if name in row.ratios and _comparable(row, last, name)
        ]
        before = before[-WINDOW:]
        found.append(Change(name, now, statistics.median(before) if len(before) >= ENOUGH else None))
    return tuple(found)


def _comparable(row: Row, other: Row, name: str) -> bool:
    """The same kind of machine, and the same version of the peer that a ratio names."""
    peer = name.rsplit(": ", 1)[-1].split(" ")[0].lower()
    return row.machine == other.machine and row.versions.get(peer) == other.versions.get(peer)


def read(path: Path) -> tuple[Row, ...]:
    """The rows of a history; empty if there is no file yet.

    Raises:
        InputError: the file is not a history.
    """
    if not path.exists():
        return ()
    remedy = "move it away, and the next run begins a new one"
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"the history '{path}' cannot be read ({error}); {remedy}.") from None
    if not isinstance(data, dict) or data.get("version") != VERSION:
        raise InputError(f"the history '{path}' is not of version {VERSION}; {remedy}.")
    try:
        return tuple(_checked(row) for row in data["rows"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"the history '{path}' has a row that is none ({error}); {remedy}.") from None


def _checked(data: Mapping[str, Any]) -> Row:
    row = Row(**data)
    texts = [row.time, row.commit, row.machine, *row.versions, *row.versions.values(), *row.ratios]
    if not all(isinstance(text, str) for text in texts):
        raise TypeError("a name is not text")
    for name, ratio in {**row.ratios, "load": row.load, "seconds": row.seconds}.items():
        if isinstance(ratio, bool) or not isinstance(ratio, int | float) or not math.isfinite(ratio):
            raise ValueError(f"'{name}' is {ratio!r}")
    return row


def write(path: Path, rows: Sequence[Row]) -> None:
    """Write the history atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    data = {"version": VERSION, "rows": [asdict(row) for row in rows]}
    write_atomically(path, json.dumps(data, indent=1) + "\n")
