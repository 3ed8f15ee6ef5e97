"""Every case that falls short of something, by what it falls short of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from missing_physics.challenge.scoring.result import CaseScore
from missing_physics.challenge.scoring.summary import ENOUGH, told_apart

__all__ = ["shortfalls"]


def shortfalls(cases: Sequence[CaseScore]) -> dict[str, tuple[str, ...]]:
    """What was missed, and the numbers of all cases that missed it, with what is to be known of each."""
    found = {
        "place not right": _places(cases),
        "not everything hidden named": _unnamed(cases),
        "a name that is not there (probability)": _wrong(cases),
        f"under {ENOUGH:.0%} of the true model's improvement": _improvements(cases),
        "true parameter outside its interval": _intervals(cases),
    }
    return {what: tuple(entries) for what, entries in found.items()}


def _places(cases: Sequence[CaseScore]) -> Iterator[str]:
    return (f"{case.number}" for case in cases if case.place is False)


def _unnamed(cases: Sequence[CaseScore]) -> Iterator[str]:
    for case in cases:
        if case.right_name is False:
            why = "in its set" if case.in_set else "" if told_apart(case) else "not identifiable"
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
