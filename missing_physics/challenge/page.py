"""The score as a page of Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from missing_physics.challenge.families import FAMILIES, FIRST_SCORING_SEED, MEANING, SCORED
from missing_physics.challenge.foreign import KINDS
from missing_physics.challenge.result import CaseScore, Report
from missing_physics.challenge.summary import FEW, Goal, Row, Share, Summary, summary_of

__all__ = ["case_line", "interval", "markdown", "percent", "wanted"]

INTRODUCTION = """\
Each case is drawn from its number: a shipped robot with other masses, lengths, friction and gains, two
motions, a controller, sensors, and something left out of the robot file. Exudyn moves the real robot; the
diagnosis, which uses the other engine, gets the robot file and the two recordings and nothing else
({isolation}). The truth was sealed before the first diagnosis and opened after the last answer was on disk.
Every number below is counted by the program from the answers as they are; a goal that is missed says so."""
IDENTIFIABLE = """\
`identifiable` is judged from the true model's Fisher information alone: what the effect does must stand out
from the sensors' noise after credible errors of the nominal robot and the nearest effect that is no less
simple have taken over what they can. Of {cases} hidden effects {clear} are."""
IMPROVEMENT = """\
The median answer reaches {share} of the true model's improvement of the held-out error, both simulated in
closed loop."""
BASELINES = """\
Single identifiable effects; `none` and `foreign` cases for silence. The error is the median rms of the
held-out torque over the sensors' noise, along the exact motion, which the simpler methods are given and the
diagnosis is not."""


def markdown(report: Report, *, command: str, environment: str) -> str:
    """The whole page.

    Args:
        report: a scored challenge.
        command: what makes it again.
        environment: date, versions and machine, in one sentence.
    """
    found = summary_of(report)
    parts = [
        "# Blind challenge",
        f"Made by `{command}`. {environment}",
        INTRODUCTION.format(isolation=report.facts["isolation of the diagnosis"]) + "\n\n" + _seeds(report),
        "## Goals\n\n" + _goals(found.goals) + "\n\n" + _improvement(found),
        _identifiable(report.scores),
        "## Families\n\n" + _rows("family", found.families) + "\n\n" + _meanings(),
        "## Hidden effects\n\n" + _rows("effect", found.effects),
        "## Robots\n\n" + _rows("robot", found.robots),
        "## Named against hidden (single effects)\n\n" + _confusion(found),
        "## Stated probability against share right\n\n" + _calibration(found),
        "## Beside simpler methods\n\n" + _baselines(found),
        "## Cases that failed\n\n" + _failures(report, found),
        "## Seal\n\n" + _table(["", ""], [[k, f"`{v}`"] for k, v in report.facts.items()]),
    ]
    return "\n\n".join(parts) + "\n"


def _seeds(report: Report) -> str:
    first = report.facts["first case"]
    kind = (
        "kept for scoring" if first >= FIRST_SCORING_SEED else "for development, so that they prove nothing"
    )
    last = first + report.facts["cases"] - 1
    before = [(own, day) for own, day in SCORED if own[0] < first]
    told = [f"{own[0]} to {own[-1]} (on {day})" for own, day in before]
    scored = f" Scored before, and used up: {', '.join(told)}." if told else ""
    return f"Cases {first} to {last}: numbers {kind}.{scored}"


def percent(value: float) -> str:
    """Without decimals where they say nothing."""
    return "-" if value != value else f"{100 * value:.1f} %"


def interval(share: Share) -> str:
    """Share, counts and Wilson's interval."""
    if not share.count:
        return "-"
    low, high = share.interval
    return f"{percent(share.value)} ({share.hits}/{share.count}; {100 * low:.0f} to {100 * high:.0f} %)"


def wanted(goal: Goal) -> str:
    """What the goal is, in words."""
    if goal.least > 0 and goal.most < 1:
        return f"{percent(goal.least)} to {percent(goal.most)}"
    return f"at least {percent(goal.least)}" if goal.least > 0 else f"at most {percent(goal.most)}"


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in lines)


def _goals(goals: Sequence[Goal]) -> str:
    rows = [[goal.name, wanted(goal), interval(goal.share), goal.verdict] for goal in goals]
    return _table(["measure", "goal", "measured (95 % interval)", ""], rows)


def _improvement(found: Summary) -> str:
    if found.improvement is None:
        return "No case in which the true model improves the held-out error."
    return IMPROVEMENT.format(share=percent(found.improvement))


def _identifiable(cases: Sequence[CaseScore]) -> str:
    flags = [flag for case in cases for flag in case.identifiable.values()]
    return IDENTIFIABLE.format(cases=len(flags), clear=sum(flags))


def _rows(what: str, rows: Sequence[Row]) -> str:
    headings = [what, "cases", "place right", "name right where identifiable", "confidently wrong", "seconds"]
    cells = [
        [r.name, str(r.cases), interval(r.place), interval(r.named), interval(r.wrong), f"{r.seconds:.0f}"]
        for r in rows
    ]
    return _table(headings, cells)


def _meanings() -> str:
    kinds = ", ".join(kind.replace("_", " ") for kind in KINDS)
    lines = [f"- `{family}`: {MEANING[family]}" for family in FAMILIES]
    return "\n".join(lines) + f"\n\nForeign kinds: {kinds}."


def _confusion(found: Summary) -> str:
    rows = [[truth, named, str(count)] for (truth, named), count in found.confusion.items()]
    return _table(["hidden", "named", "cases"], rows)


def _calibration(found: Summary) -> str:
    rows = [
        [f"{low:.1f} to {high:.1f}", f"{mean:.3f}", interval(share), "few" if share.count < FEW else ""]
        for low, high, mean, share in found.calibration
    ]
    return _table(["stated", "mean", "right", ""], rows)


def _baselines(found: Summary) -> str:
    rows = [
        [
            b.name,
            interval(b.named),
            interval(b.silent),
            "-" if b.error is None else f"{b.error:.2f}",
            b.note,
        ]
        for b in found.baselines
    ]
    headings = [
        "method",
        "names exactly the hidden effect",
        "silent where there is none",
        "held-out error",
        "",
    ]
    return _table(headings, rows) + "\n\n" + BASELINES


def case_line(case: CaseScore) -> str:
    """What is hidden in a case and what was said, in one line."""
    hidden = ", ".join(case.hidden) or case.foreign or "nothing"
    named = ", ".join(f"{f.label} ({f.probability:.2f})" for f in case.findings) or "nothing"
    words = case.message.splitlines()[-1] if case.message else ""
    return f"hidden {hidden}; {case.verdict}, named {named}" + (f"; {words}" if words else "")


def _failures(report: Report, found: Summary) -> str:
    lines = []
    for cause in sorted({cause for _, cause in found.failures}):
        own = [case for case, why in found.failures if why == cause]
        lines.append(f"### {cause}: {len(own)}\n")
        lines += [f"- {c.number} ({c.family}, {c.robot}): {case_line(c)}" for c in own] + [""]
    for number, words in report.unmade.items():
        lines.append(f"- {number} could not be simulated: {words}")
    again = (
        "`missing-physics challenge --show NUMBER --out DIR` diagnoses one of them again, with its report."
    )
    return "\n".join(lines or ["None.", ""]) + ("\n" + again if found.failures else "")
