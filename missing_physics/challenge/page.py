"""The score as a page of Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from missing_physics.challenge.cases.families import FAMILIES, MEANING
from missing_physics.challenge.cases.numbers import SCORED, is_kept_for_scoring
from missing_physics.challenge.cases.truth import SCHEMA
from missing_physics.challenge.draws.foreign import KINDS
from missing_physics.challenge.scoring.probability import FLOOR
from missing_physics.challenge.scoring.result import CaseScore, Report
from missing_physics.challenge.scoring.shares import FEW, NEAR, Gap, Goal, Share, within
from missing_physics.challenge.scoring.shortfalls import shortfalls
from missing_physics.challenge.scoring.summary import Row, Summary, summary_of

__all__ = ["case_line", "falls_short", "interval", "markdown", "percent", "proper_scores", "wanted"]

INTRODUCTION = """\
Each case is drawn from its number (version {version} of the draws): a shipped robot with modified masses,
lengths, friction and gains, two motions, a controller, sensors, the contents of its file, the way in which
its torque is recorded, and physics that its file omits. Exudyn simulates the real robot; the diagnosis,
which uses the other engine, gets the robot file and the two recordings and nothing else
({isolation}). The truth was encrypted before the first diagnosis and decrypted after the last answer.
All numbers below are computed by the program from these answers; missed goals are marked."""
IDENTIFIABLE = """\
`identifiable` is judged from the true model's Fisher information alone: the effect must exceed
the sensors' noise after credible errors of the nominal robot and the nearest effect that is no less
simple have explained as much of it as they can. Of {cases} hidden effects {clear} are identifiable."""
IMPROVEMENT = """\
The median answer reaches {share} of the true model's improvement of the held-out error, both simulated in
closed loop."""
UNRUN = " {count} of these cases have no answer, or one that cannot be simulated; they count as missed."
SHORT = """\
{missed} The cases are listed below; docs/challenge.md describes how they are drawn and counted. {scored}
One case is made, diagnosed and scored again, from nothing but its number N, by
`missing-physics challenge --cases 1 --seed N --out DIR`."""
CALIBRATION = """\
Deciles with fewer than {few} findings do not count for the goal of {near:.0%}. The last column is `near` or
`far` if Wilson's interval lies wholly within or beyond {near:.0%} of the mean stated probability. Ten
findings show only large deviations; to prove small ones takes more than a hundred."""
PROPER = """\
Per case, over all effects at places that the answer mentions or that are hidden: logarithmic score
{log:.3f} nats (0 is perfect; probabilities count as at least {floor:g}), Brier score {brier:.3f}."""
BASELINES = """\
Single identifiable effects; `none` and `foreign` cases for no finding. The error is the median rms of the
held-out torque relative to the sensors' noise, along the exact motion, which the simpler methods are given
and the diagnosis is not."""


def markdown(report: Report, *, command: str, environment: str) -> str:
    """The whole page.

    Args:
        report: a scored challenge.
        command: the command that reproduces it.
        environment: date, versions and machine, in one sentence.
    """
    found = summary_of(report)
    parts = [
        "# Blind challenge",
        f"Made by `{command}`. {environment}",
        INTRODUCTION.format(version=SCHEMA, isolation=report.facts["isolation of the diagnosis"])
        + "\n\n"
        + _seeds(report),
        "## Goals\n\n" + _goals(found.goals) + "\n\n" + _improvement(found),
        "## What falls short\n\n" + falls_short(report, found),
        _identifiable(report.scores),
        "## Families\n\n" + _rows("family", found.families) + "\n\n" + _meanings(),
        "## Hidden effects\n\n" + _rows("effect", found.effects),
        "## Robots\n\n" + _rows("robot", found.robots),
        "## Conditions\n\n" + _rows("condition", found.conditions),
        "## Named against hidden (single effects)\n\n" + _confusion(found),
        "## Stated probability against share right\n\n" + _calibration(found) + "\n\n" + proper_scores(found),
        "## Comparison with simpler methods\n\n" + _baselines(found),
        "## Cases that failed\n\n" + _failures(report, found),
        "## What was missed\n\n" + _shortfalls(report),
        "## Seal\n\n" + _table(["", ""], [[k, f"`{v}`"] for k, v in report.facts.items()]),
    ]
    return "\n\n".join(parts) + "\n"


def _seeds(report: Report) -> str:
    first = report.facts["first case"]
    kind = "kept for scoring" if is_kept_for_scoring(first) else "for development, so that they prove nothing"
    last = first + report.facts["cases"] - 1
    before = [(own, day) for own, day in SCORED if own[0] < first]
    used = [f"{own[0]} to {own[-1]} (on {day})" for own, day in before]
    scored = f" Scored before, and used up: {', '.join(used)}." if used else ""
    return f"Cases {first} to {last}: numbers {kind}.{scored}"


def falls_short(report: Report, found: Summary) -> str:
    """Missed goals, the number of earlier scores, and how to repeat a case."""
    names = [f"{goal.name} ({_value(goal.share)})" for goal in found.goals if _missed(goal)]
    bounded = sum(goal.bounded and bool(goal.share.count) for goal in found.goals)
    missed = f"Of {bounded} goals {len(names)} are missed" + (f": {'; '.join(names)}." if names else ".")
    first = report.facts["first case"]
    times = sum(own[0] < first for own, _ in SCORED)
    scored = f"Numbers kept for scoring were scored {times} times before these."
    return SHORT.format(missed=missed, scored=scored)


def _missed(goal: Goal) -> bool:
    return goal.verdict.startswith("missed")


def percent(value: float) -> str:
    """A fraction in percent; `-` for NaN."""
    return "-" if value != value else f"{100 * value:.1f} %"


def interval(share: Share | Gap) -> str:
    """Fraction, counts and Wilson's interval; for calibration the largest distance and its decile."""
    if not share.count:
        return "-"
    if isinstance(share, Gap):
        assert share.worst is not None
        low, high, mean, right = share.worst
        where = f"{low:.1f} to {high:.1f}: stated {mean:.3f}, right {interval(right)}"
        return f"{_value(share)} ({where})"
    low, high = share.interval
    return f"{_value(share)} ({share.hits}/{share.count}; {100 * low:.0f} to {100 * high:.0f} %)"


def _value(share: Share | Gap) -> str:
    """Value in percent; a distance in percentage points."""
    return f"{100 * share.value:.1f} points" if isinstance(share, Gap) else percent(share.value)


def wanted(goal: Goal) -> str:
    """Description of the goal."""
    if not goal.bounded:
        return "-"
    if isinstance(goal.share, Gap):
        return f"at most {100 * goal.most:.0f} points"
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
    words = IMPROVEMENT.format(share=percent(found.improvement))
    return words + (UNRUN.format(count=found.unrun) if found.unrun else "")


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
        [
            f"{low:.1f} to {high:.1f}",
            f"{mean:.3f}",
            interval(share),
            f"{100 * abs(mean - share.value):.1f}",
            "few" if share.count < FEW else "yes",
            {True: "near", False: "far", None: ""}[within((low, high, mean, share))],
        ]
        for low, high, mean, share in found.calibration
    ]
    table = _table(["stated", "mean", "right", "distance [points]", "counts", "result"], rows)
    return table + "\n\n" + CALIBRATION.format(few=FEW, near=NEAR)


def proper_scores(found: Summary) -> str:
    """Sentence with the proper scores of all stated probabilities."""
    if found.log_score is None or found.brier is None:
        return "No case."
    return PROPER.format(log=found.log_score, brier=found.brier, floor=FLOOR)


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
        "no finding if nothing is hidden",
        "held-out error",
        "",
    ]
    return _table(headings, rows) + "\n\n" + BASELINES


def case_line(case: CaseScore) -> str:
    """Hidden physics of a case and its answer, in one line."""
    hidden = ", ".join(case.hidden) or case.foreign or "nothing"
    named = ", ".join(f"{f.label} ({f.probability:.2f})" for f in case.findings) or "nothing"
    words = case.message.splitlines()[-1] if case.message else ""
    return f"hidden {hidden}; {case.verdict}, named {named}" + (f"; {words}" if words else "")


def _shortfalls(report: Report) -> str:
    found = shortfalls(report.scores).items()
    return "\n".join(
        f"- {what}: {len(cases)}" + (f": {'; '.join(cases)}." if cases else ".") for what, cases in found
    )


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
