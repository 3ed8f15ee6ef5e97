"""Cases that miss a goal, by goal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from missing_physics.challenge.scoring.result import CaseScore
from missing_physics.challenge.scoring.summary import ENOUGH, all_identifiable

__all__ = ["shortfalls"]


def shortfalls(cases: Sequence[CaseScore]) -> dict[str, tuple[str, ...]]:
    """Missed goals, and the numbers of the cases that missed them, with details of each."""
    found = {
        "place not right": _places(cases),
        "not everything hidden named": _unnamed(cases),
        "a wrong name (probability)": _wrong(cases),
        f"under {ENOUGH:.0%} of the true model's improvement": _improvements(cases),
        "true parameter outside its interval": _intervals(cases),
    }
    return {what: tuple(entries) for what, entries in found.items()}


def _places(cases: Sequence[CaseScore]) -> Iterator[str]:
    return (f"{case.number}" for case in cases if case.place is False)


def _unnamed(cases: Sequence[CaseScore]) -> Iterator[str]:
    for case in cases:
        if case.right_name is False:
            why = "in its set" if case.in_set else "" if all_identifiable(case) else "not identifiable"
            yield f"{case.number} ({why})" if why else f"{case.number}"


def _wrong(cases: Sequence[CaseScore]) -> Iterator[str]:
    return (f"{case.number} {f.label} ({f.probability:.2f})" for case in cases for f in case.wrong)


def _improvements(cases: Sequence[CaseScore]) -> Iterator[str]:
    for case in cases:
        if not case.hidden or not case.improvable:
            continue
        if case.improvement is None:
            yield f"{case.number} (no answer that runs)"
        elif not case.improvement >= ENOUGH:
            yield f"{case.number} ({case.improvement:.0%})"


def _intervals(cases: Sequence[CaseScore]) -> Iterator[str]:
    for case in cases:
        for finding in case.findings:
            missed = [name for name, hit in finding.covered.items() if not hit]
            if missed:
                yield f"{case.number} {finding.label} ({', '.join(missed)})"
