"""The yardstick's page: one engine's results on the cases, each half in a separate column.

Single cases are listed for the half that may be looked at; for the other one only counts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import fmean, median

from benchmarks.evidence import head, number, table
from missing_physics.challenge.cases.numbers import Half, half_of
from missing_physics.challenge.page import case_line, interval, percent, wanted
from missing_physics.challenge.scoring.paired import Comparison, Difference
from missing_physics.challenge.scoring.probability import FLOOR
from missing_physics.challenge.scoring.result import CaseScore, Report
from missing_physics.challenge.scoring.summary import Row, Summary, summary_of

__all__ = ["TITLES", "comparison_table", "page"]

TITLES: Mapping[Half, str] = {"looked": "looked at", "counted": "counted only"}
INTRODUCTION = """\
Cases of the numbers 50000 to 50299, drawn as those of the blind challenge (docs/challenge.md) and moved by
the other engine. Even numbers may be looked at during development; odd ones are counted only. The engine
`{label}` got each case through the command line, in a separate process, with only the case folder.

Scores are per case. The logarithmic score and Brier's sum over all effects at places that the answer mentions
or that are true (probabilities count as at least {floor:g}); 0 is perfect. The held-out error is that of the
joints' torques, each in units of its noise, of the answer relative to the nominal robot, where physics is
missing. Seconds are processor time."""


def page(
    label: str,
    scores: Sequence[CaseScore],
    unmade: Mapping[int, str],
    *,
    command: str,
    comparison: tuple[str, Comparison] | None = None,
) -> str:
    """The page in Markdown.

    Args:
        label: of the engine.
        scores: of all cases that were answered.
        unmade: cases that could not be made, and why.
        command: that makes the page.
        comparison: label of an earlier engine, and both on the cases that both have answered.
    """
    halves = {half: [case for case in scores if half_of(case.number) == half] for half in TITLES}
    halves = {half: cases for half, cases in halves.items() if cases}
    found = {half: summary_of(Report(tuple(cases), {}, {})) for half, cases in halves.items()}
    parts = [
        head(f"Simulated yardstick: {label}", command=command),
        INTRODUCTION.format(label=label, floor=FLOOR),
        "## Measures\n\n" + _measures(halves, found),
        *([_compared(label, *comparison)] if comparison else []),
        "## Failures by cause\n\n" + _causes(halves, found),
        "## Families\n\n" + _groups("family", {half: s.families for half, s in found.items()}),
        "## Conditions\n\n" + _groups("condition", {half: s.conditions for half, s in found.items()}),
        "## Hidden effects\n\n" + _groups("effect", {half: s.effects for half, s in found.items()}),
        "## Failed cases that may be looked at\n\n" + _failed(found.get("looked")),
        *(["## Cases that could not be made\n\n" + _unmade(unmade)] if unmade else []),
    ]
    return "\n\n".join(parts) + "\n"


def _measures(halves: Mapping[Half, list[CaseScore]], found: Mapping[Half, Summary]) -> str:
    rows = [["cases", "", *(str(len(cases)) for cases in halves.values())]]
    for goals in zip(*(summary.goals for summary in found.values())):
        rows.append([goals[0].name, wanted(goals[0]), *(interval(goal.share) for goal in goals)])
    means = {"logarithmic score [nats]": "log_score", "Brier score": "brier"}
    for name, key in means.items():
        values = (fmean(getattr(case, key) for case in cases) for cases in halves.values())
        rows.append([f"{name}, mean", "", *(f"{value:.3f}" for value in values)])
    rows.append(["held-out error over the nominal robot's, median", "", *map(_ratio, halves.values())])
    seconds = ([case.seconds for case in cases] for cases in halves.values())
    rows.append(["seconds, median and longest", "", *(f"{median(s):.0f}, {max(s):.0f}" for s in seconds)])
    return table(["measure", "goal", *(f"{TITLES[half]}:" for half in halves)], rows)


def _ratio(cases: Sequence[CaseScore]) -> str:
    """Measures over cases with hidden physics."""
    ratios = [case.held_out_ratio for case in cases if case.hidden or case.foreign]
    known = [ratio for ratio in ratios if ratio is not None]
    return f"{median(known):.3f}" if known else "-"


def _causes(halves: Mapping[Half, list[CaseScore]], found: Mapping[Half, Summary]) -> str:
    counts = {half: Counter(cause for _, cause in summary.failures) for half, summary in found.items()}
    causes = sorted(
        set().union(*counts.values()), key=lambda cause: (-sum(c[cause] for c in counts.values()), cause)
    )
    rows = [[cause, *(str(counts[half][cause]) for half in halves)] for cause in causes]
    rows.append(["none", *(str(len(halves[half]) - sum(counts[half].values())) for half in halves)])
    return table(["cause", *(f"{TITLES[half]}:" for half in halves)], rows)


def _groups(what: str, groups: Mapping[Half, Sequence[Row]]) -> str:
    names = list(dict.fromkeys(row.name for rows in groups.values() for row in rows))
    by_name = {half: {row.name: row for row in rows} for half, rows in groups.items()}
    cells = []
    for name in names:
        own = [by_name[half].get(name) for half in groups]
        cells.append([name, *(cell for row in own for cell in _cells(row))])
    columns = ("cases:", "place:", "name where identifiable:", "wrong above 0.9:")
    return table([what, *(f"{TITLES[half]}, {column}" for half in groups for column in columns)], cells)


def _cells(row: Row | None) -> list[str]:
    if row is None or not row.cases:
        return ["0", "-", "-", "-"]
    shares = (row.place, row.named, row.wrong)
    return [str(row.cases), *(f"{s.hits}/{s.count}" if s.count else "-" for s in shares)]


def _failed(summary: Summary | None) -> str:
    lines = []
    for cause in sorted({cause for _, cause in summary.failures}) if summary else ():
        assert summary is not None
        own = [case for case, why in summary.failures if why == cause]
        lines += [f"**{cause}**", "", *map(_line, own), ""]
    return "\n".join(lines).rstrip() or "None."


def _line(case: CaseScore) -> str:
    conditions = ", ".join(f"{factor} {level}" for factor, level in case.conditions.items())
    return f"- {case.number} ({case.family}, {case.robot}; {conditions}): {case_line(case)}"


def _unmade(unmade: Mapping[int, str]) -> str:
    return "\n".join(f"- {case}: {message}" for case, message in sorted(unmade.items()))


def _compared(label: str, other: str, comparison: Comparison) -> str:
    return (
        f"## Beside `{other}`\n\nOn the {comparison.cases} cases that both have answered, case by case.\n\n"
        + comparison_table(other, label, comparison)
    )


def comparison_table(first: str, second: str, comparison: Comparison) -> str:
    """Two engines, a row for each measure."""
    headings = [
        "measure",
        "cases:",
        f"{first}:",
        f"{second}:",
        "difference (95 %):",
        "better:",
        "worse:",
        "p:",
    ]
    return table(headings, [_difference(row) for row in comparison.differences])


def _difference(row: Difference) -> list[str]:
    shown = percent if row.is_share else number
    low, high = row.interval
    return [
        row.name,
        str(row.cases),
        shown(row.first),
        shown(row.second),
        f"{shown(row.difference)} ({shown(low)} to {shown(high)})",
        str(row.better),
        str(row.worse),
        f"{row.p_value:.2g}",
    ]
