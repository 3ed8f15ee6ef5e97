"""Summary of the scores of all cases: goals, families, effects, confusion, calibration."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean, median

from missing_physics.challenge.cases.families import FAMILIES
from missing_physics.challenge.scoring.result import NO_ANSWER, CaseScore, Finding, Report
from missing_physics.challenge.scoring.shares import FEW, NEAR, Gap, Goal, Share, Tenth, wilson

__all__ = [
    "ENOUGH",
    "FEW",
    "Baseline",
    "Goal",
    "Row",
    "Share",
    "Summary",
    "all_identifiable",
    "cause_of",
    "confidently_wrong",
    "false_alarm",
    "summary_of",
    "wilson",
]

#: A wrong name with a higher stated probability counts as confident.
CONFIDENT = 0.9
#: Fraction of the true model's improvement that an answer should reach.
ENOUGH = 0.8
#: Number of intervals of stated probability.
DECILES = 10
#: Marks the right effect at a wrong place.
ELSEWHERE = ", elsewhere"


@dataclass(frozen=True)
class Row:
    """A group of cases: place right, name right where identifiable, confidently wrong."""

    name: str
    cases: int
    place: Share
    named: Share
    wrong: Share
    seconds: float


@dataclass(frozen=True)
class Baseline:
    """Named effects of a method, and its median held-out error relative to the sensors' noise."""

    name: str
    named: Share
    silent: Share
    error: float | None
    note: str


@dataclass(frozen=True)
class Summary:
    """Contents of a report.

    Attributes:
        goals: overall results.
        families, effects, robots, conditions: results by group; for conditions by each level of each factor.
        log_score, brier: means over all cases; None without cases.
        confusion: counts by (hidden effect, most probable name); see `ELSEWHERE`.
        calibration: deciles of stated probability.
        baselines: results of the simpler methods and of the diagnosis.
        failures: failed cases and causes.
        improvement: median of the answer's improvement relative to the true model's, zero without an answer
        that
            can be simulated; None without cases.
        unrun: number of improvable cases without an answer that can be simulated.
    """

    goals: tuple[Goal, ...]
    families: tuple[Row, ...]
    effects: tuple[Row, ...]
    robots: tuple[Row, ...]
    conditions: tuple[Row, ...]
    log_score: float | None
    brier: float | None
    confusion: dict[tuple[str, str], int]
    calibration: tuple[Tenth, ...]
    baselines: tuple[Baseline, ...]
    failures: tuple[tuple[CaseScore, str], ...]
    improvement: float | None
    unrun: int


def summary_of(report: Report) -> Summary:
    """Summarise a challenge."""
    cases = report.scores
    ratios = [case.improvement or 0.0 for case in cases if case.hidden and case.improvable]
    effects = sorted({label.split("@")[0] for case in cases for label in case.hidden})
    return Summary(
        goals=_goals(cases),
        families=tuple(_row(f, [c for c in cases if c.family == f]) for f in FAMILIES),
        effects=tuple(_row(e, [c for c in cases if e in _effects(c)]) for e in effects),
        robots=tuple(_row(r, [c for c in cases if c.robot == r]) for r in sorted({c.robot for c in cases})),
        conditions=_conditions(cases),
        log_score=fmean(case.log_score for case in cases) if cases else None,
        brier=fmean(case.brier for case in cases) if cases else None,
        confusion=_confusion(cases),
        calibration=_calibration([finding for case in cases for finding in case.findings]),
        baselines=_baselines(cases),
        failures=tuple((case, cause) for case in cases if (cause := cause_of(case))),
        improvement=median(ratios) if ratios else None,
        unrun=sum(bool(c.hidden) and c.improvable and c.improvement is None for c in cases),
    )


def _conditions(cases: Sequence[CaseScore]) -> tuple[Row, ...]:
    """A row for each level of each factor, in the order of the factors."""
    levels = sorted({level for case in cases for level in case.conditions.items()})
    factors = list(dict.fromkeys(factor for case in cases for factor in case.conditions))
    return tuple(
        _row(f"{factor}: {level}", [case for case in cases if case.conditions.get(factor) == level])
        for factor, level in sorted(levels, key=lambda item: (factors.index(item[0]), item[1]))
    )


def _effects(case: CaseScore) -> set[str]:
    return {label.split("@")[0] for label in case.hidden}


def all_identifiable(case: CaseScore) -> bool:
    """Whether all hidden effects are identifiable according to the true model."""
    return bool(case.hidden) and all(case.identifiable.values())


def _share(cases: Iterable[CaseScore], right: Callable[[CaseScore], bool | None]) -> Share:
    """Fraction of right cases among those to which the question applies (the answer is not None)."""
    answers = [bool(answer) for case in cases if (answer := right(case)) is not None]
    return Share(sum(answers), len(answers))


def confidently_wrong(case: CaseScore) -> bool:
    """Whether a wrong name is stated with more than `CONFIDENT`."""
    return any(finding.probability > CONFIDENT for finding in case.wrong)


def false_alarm(case: CaseScore) -> bool | None:
    """Whether physics is reported as missing although none is; None if some is missing.

    With errors in the robot file only a wrong name is a false alarm.
    """
    if case.family != "none":
        return None
    return bool(case.wrong) or (case.file_exact and case.verdict != "consistent")


def _goals(cases: Sequence[CaseScore]) -> tuple[Goal, ...]:
    clear = [case for case in cases if all_identifiable(case)]
    single = [case for case in clear if case.family != "mixed"]
    mixed = [case for case in clear if case.family == "mixed"]
    all_single = [case for case in cases if case.family != "mixed"]
    all_mixed = [case for case in cases if case.family == "mixed"]
    foreign = [case for case in cases if case.family == "foreign"]
    covered = [hit for case in cases for f in case.findings for hit in f.covered.values()]
    better = [(case.improvement or 0.0) >= ENOUGH for case in cases if case.improvable and case.hidden]
    return (
        Goal("place right, identifiable effects", _share(clear, lambda c: c.place), least=0.98),
        Goal(
            "place right, everything hidden, foreign physics too",
            _share(cases, lambda c: c.place),
            least=0.98,
        ),
        Goal("name right, identifiable single effects", _share(single, lambda c: c.right_name), least=0.95),
        Goal("name right, all single effects", _share(all_single, lambda c: c.right_name)),
        Goal(
            "exactly the hidden effect and nothing else, identifiable single effects",
            _share(single, lambda c: c.exactly),
        ),
        Goal(
            "all names right, identifiable mixed effects", _share(mixed, lambda c: c.right_name), least=0.85
        ),
        Goal("all names right, all mixed effects", _share(all_mixed, lambda c: c.right_name), least=0.85),
        Goal("a wrong name stated with more than 0.9", _share(cases, confidently_wrong), most=0.01),
        Goal(
            "false alarm where nothing is missing",
            _share(cases, false_alarm),
            most=0.02,
        ),
        Goal(
            "foreign physics left unnamed",
            _share(foreign, lambda c: not c.wrong and c.verdict != NO_ANSWER),
            least=0.90,
        ),
        Goal("truth inside the ambiguous set", _share(cases, lambda c: c.in_set), least=0.95),
        Goal("true parameter inside its 95 % interval", Share(sum(covered), len(covered)), 0.90, 0.98),
        Goal("at least 80 % of the true model's improvement", Share(sum(better), len(better)), least=0.95),
        Goal(
            f"largest distance of stated from right, tenths with {FEW} findings and more",
            Gap.of(_calibration([finding for case in cases for finding in case.findings])),
            most=NEAR,
        ),
    )


def _row(name: str, cases: Sequence[CaseScore]) -> Row:
    clear = [case for case in cases if all_identifiable(case)]
    seconds = [case.seconds for case in cases]
    return Row(
        name,
        len(cases),
        _share(cases, lambda c: c.place),
        _share(clear, lambda c: c.right_name),
        _share(cases, confidently_wrong),
        median(seconds) if seconds else 0.0,
    )


def _confusion(cases: Sequence[CaseScore]) -> dict[tuple[str, str], int]:
    """Counts of single hidden effects and of the most probable finding, right or not."""
    found: dict[tuple[str, str], int] = {}
    for case in cases:
        if len(case.hidden) > 1:
            continue
        truth = case.hidden[0].split("@")[0] if case.hidden else case.family
        best = max(case.findings, key=lambda f: f.probability, default=None)
        named = best.label.split("@")[0] if best else f"({case.verdict})"
        if best and named == truth and best.label not in case.hidden:
            named += ELSEWHERE
        found[truth, named] = found.get((truth, named), 0) + 1
    return dict(sorted(found.items()))


def _calibration(findings: Sequence[Finding]) -> tuple[Tenth, ...]:
    rows = []
    for tenth in range(DECILES):
        low, high = tenth / DECILES, (tenth + 1) / DECILES
        own = [f for f in findings if low <= f.probability < high or (tenth == 9 and f.probability == 1.0)]
        if own:
            mean = sum(f.probability for f in own) / len(own)
            rows.append((low, high, mean, Share(sum(f.right for f in own), len(own))))
    return tuple(rows)


def _baselines(cases: Sequence[CaseScore]) -> tuple[Baseline, ...]:
    """For single identifiable effects exactly right names, without hidden effects no names."""
    single = [c for c in cases if all_identifiable(c) and len(c.hidden) == 1]
    nothing = [c for c in cases if not c.hidden]
    rows = []
    for name in dict.fromkeys(name for case in cases for name in case.models):
        errors = [e for c in single if (e := c.models[name].error) is not None]
        notes = {case.models[name].note for case in cases} - {"", NO_ANSWER}
        rows.append(
            Baseline(
                name,
                _share(single, lambda c, n=name: set(c.models[n].named) == set(c.hidden)),  # type: ignore[misc]
                _share(nothing, lambda c, n=name: not c.models[n].named),  # type: ignore[misc]
                median(errors) if errors else None,
                "; ".join(sorted(notes)),
            )
        )
    return tuple(rows)


def cause_of(case: CaseScore) -> str:
    """Why a case failed; empty if it did not."""
    if case.verdict == NO_ANSWER:
        return NO_ANSWER
    if case.family == "none":
        return "false alarm" if false_alarm(case) else ""
    if case.foreign:
        return "foreign physics named" if case.wrong else "" if case.place else "foreign physics not located"
    if case.in_set is False:
        return "truth outside the ambiguous set"
    if not case.right_name:
        return _unnamed(case)
    return "named, and a wrong effect besides" if case.wrong else ""


def _unnamed(case: CaseScore) -> str:
    """Why a hidden effect was not named."""
    if not all_identifiable(case):
        return "" if not confidently_wrong(case) else "wrong name where the data cannot tell"
    if not case.findings:
        return f"nothing named ({case.verdict})"
    if case.in_set:
        return ""
    if not case.place:
        return "named at another place"
    part = any(label in {f.label for f in case.findings} for label in case.hidden)
    return "a part named" if part else "another name at the place"
