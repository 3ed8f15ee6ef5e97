"""Text of the page of `hard_pairs`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from benchmarks.effects.runs import Key, Row
from benchmarks.effects.text import absent, companions, covered, finding_text, reason, strangers
from benchmarks.evidence import head, number, table

if TYPE_CHECKING:
    from benchmarks.effects.hard_pairs import Pair

__all__ = ["page"]

INTRODUCTION = """\
Effects that can be confused according to the catalogue, each hidden alone in turn, in recordings made by
Exudyn and judged as in [effects.md](effects.md). *Said* lists all names of the diagnosis, with probability
and equally possible effects; *rivals* are explanations fitted in place of the finding, with their
probability."""
ALIKE = "The recordings do not distinguish them: the verdict must be `ambiguous`, and list each."
#: Rivals less probable than this are not listed.
WORTH_SHOWING = 1e-3


def page(parts: Sequence[tuple[Pair, Sequence[Row]]], *, command: str, missing: Sequence[Key] = ()) -> str:
    """The complete page, in Markdown; `missing` are cases that have not been run."""
    answered = [(pair, row) for pair, own in parts for row in own]
    right = sum(_right(pair, row) for pair, row in answered)
    found = [
        head("Hard pairs, each way round", command=command),
        INTRODUCTION,
        f"{right} of {len(answered)} answers are right.",
        f"Seeds: {', '.join(str(row.key.number) for _, row in answered)}.",
        absent(missing),
        *(_section(pair, own) for pair, own in parts if own),
    ]
    return "\n\n".join(filter(None, found)) + "\n"


def _right(pair: Pair, row: Row) -> bool:
    """Only the hidden effect is named, or listed with its twin in the recorded channels.

    Indistinguishable effects must all be listed.
    """
    if pair.alike:
        stated = {label.split("@")[0] for f in row.findings for label in (f["effect"], *f["ambiguous_with"])}
        return row.verdict == "ambiguous" and {truth.effect for truth in pair.truths} <= stated
    if row.name_right:
        return not strangers(row)
    return row.in_set and not row.identifiable


def _section(pair: Pair, rows: Sequence[Row]) -> str:
    headings = ["case", "truth", "verdict", "right", "said", "estimates", "rivals"]
    lines = [_line(pair, row) for row in rows]
    reasons = [
        f"- {row.key.number}: {words}" for row in rows if not _right(pair, row) and (words := reason(row))
    ]
    place = f"Robot: {pair.robot}{', ' + pair.change if pair.change else ''}."
    parts = [f"## {pair.title}", f"{place} {ALIKE}" if pair.alike else place]
    return "\n\n".join(filter(None, [*parts, table(headings, lines), "\n".join(reasons)]))


def _line(pair: Pair, row: Row) -> list[str]:
    true = ", ".join(f"{name} {number(value)}" for name, value in row.truth.items() if value)
    rivals = "; ".join(
        f"{a['effect']}@{a['location']} {a['probability']:.2g}"
        for f in row.findings
        for a in f["alternatives"]
        if a["probability"] >= WORTH_SHOWING
    )
    beside = " (its flanks' spring)" if companions(row) else ""
    return [
        str(row.key.number),
        f"{row.label}: {true}",
        row.verdict,
        "yes" if _right(pair, row) else "no",
        "; ".join(finding_text(f) for f in row.findings) + beside or "nothing",
        "; ".join(words for words, _ in covered(row)) or "-",
        rivals or "-",
    ]
