"""The verdicts in words, shared by all writers."""

from __future__ import annotations

import math
from types import MappingProxyType

from missing_physics.reporting.elements.formatting import (
    ABSENT,
    effect_title,
    joined,
    number,
    percent,
    rival_text,
)
from missing_physics.results.result import Diagnosis, Finding, Mismatch, ParameterChange
from missing_physics.wording.numbers import within_text

__all__ = [
    "MOVED",
    "TITLE",
    "by_place",
    "improvement_text",
    "located_first_to_last",
    "meaning",
    "moved_texts",
    "name_text",
    "named_text",
    "not_judged_text",
]

TITLE = MappingProxyType(
    {
        "explained": "Explained",
        "partly_explained": "Partly explained",
        "ambiguous": "Ambiguous",
        "unexplained": "Unexplained",
        "consistent": "Consistent",
        "not_enough_data": "Not enough data",
    }
)

MEANING = MappingProxyType(
    {
        "explained": "The mismatch is named, modelled and proven on data that were not fitted.",
        "partly_explained": (
            "What is named is proven on data that were not fitted and predicts them better than the standard "
            "model, but part of the mismatch remains unexplained."
        ),
        "ambiguous": "Several explanations fit these data equally well; an experiment would separate them.",
        "unexplained": "The mismatch is real, but no known effect explains it; it is located, not named.",
        "consistent": "The nominal robot and the recording agree to within the noise.",
        "not_enough_data": "The recording cannot support a statement either way.",
    }
)

MORE_THAN_NAMED = (
    "What is named is modelled and proven on data that were not fitted; a further force has no name."
)
#: Where nothing is named.
BY_NUMBERS = MappingProxyType(
    {
        "explained": "Numbers of the robot file are off; with others it predicts what was not fitted.",
        "partly_explained": (
            "Numbers of the robot file are off; with others it predicts what was not fitted better, but part "
            "of the mismatch remains unexplained."
        ),
    }
)
#: Heading of `moved_texts`.
MOVED = "Numbers of the robot file that the recordings contradict"
NOT_ENOUGH = "The mismatch is real, and the findings do not explain it, or only with the doubts listed below."


def meaning(diagnosis: Diagnosis) -> str:
    """The verdict in one sentence."""
    if diagnosis.findings and diagnosis.comparison.written in ("standard", "nominal"):
        return diagnosis.comparison.words
    if diagnosis.verdict == "unexplained" and diagnosis.findings:
        return NOT_ENOUGH
    if diagnosis.verdict in BY_NUMBERS and not diagnosis.findings:
        return BY_NUMBERS[diagnosis.verdict]
    if diagnosis.verdict == "explained" and diagnosis.unnamed:
        return MORE_THAN_NAMED
    return MEANING[diagnosis.verdict]


def named_text(diagnosis: Diagnosis) -> str:
    """Missing effects and places, on one line; without findings, the places of the mismatch."""
    if diagnosis.findings:
        doubted = "perhaps " if diagnosis.verdict == "unexplained" else ""
        return doubted + "; ".join(_places(diagnosis))
    if diagnosis.verdict == "unexplained" and diagnosis.mismatch:
        return f"unnamed, at {joined(dict.fromkeys(m.location for m in diagnosis.mismatch))}"
    if diagnosis.verdict in BY_NUMBERS:
        return "numbers of the robot file"
    return "nothing missing" if diagnosis.verdict == "consistent" else ABSENT


def not_judged_text(diagnosis: Diagnosis) -> str:
    """``; joint2 could not be judged``, or nothing."""
    silent = diagnosis.not_judged
    return f"; {joined(silent)} could not be judged" if silent else ""


def improvement_text(diagnosis: Diagnosis) -> str:
    """Reduction of the held-out error; a dash when there is nothing to compare."""
    value = diagnosis.fit.validation_improvement
    if not math.isfinite(value) or (not diagnosis.findings and value == 0.0):
        return ABSENT
    return percent(value)


def moved_texts(diagnosis: Diagnosis) -> list[str]:
    """Parameters of the robot file that the recordings contradict, the most surprising change first."""
    moved = [change for change in diagnosis.nominal_parameters if change.moved and change.narrowed]
    return [
        f"{change.name} {within_text(change.estimate, change.ci95, change.unit)}, {_in_file(change)}"
        for change in sorted(moved, key=lambda change: -change.surprise)
    ]


def _in_file(change: ParameterChange) -> str:
    """Value in the robot file, which may not state rotors."""
    if change.nominal == 0.0 and change.name.endswith(".reflected_inertia"):
        return "not in the robot file"
    return f"in the robot file {number(change.nominal, 4)}"


def by_place(diagnosis: Diagnosis) -> dict[str, list[Finding]]:
    """The findings of each place, the place of the most probable one first."""
    found: dict[str, list[Finding]] = {}
    for finding in diagnosis.findings:
        found.setdefault(finding.location, []).append(finding)
    return found


def name_text(finding: Finding) -> str:
    """The effect; in brackets alternatives that cannot be distinguished from it."""
    rivals = [rival_text(rival, finding.location) for rival in finding.ambiguous_with]
    either = f" (or {joined(rivals, 'or')})" if rivals else ""
    return f"{effect_title(finding.effect)}{either}"


def located_first_to_last(diagnosis: Diagnosis) -> list[Mismatch]:
    """Where the nominal robot and the recording differ, by share; torques come first, then positions, whose
    shares are separate."""
    return sorted(diagnosis.mismatch, key=lambda m: (not m.channel.endswith(".torque"), -m.share))


def _places(diagnosis: Diagnosis) -> list[str]:
    """The missing effects and where they are; places with the same ones together."""
    found: dict[frozenset[str], tuple[str, list[str]]] = {}
    for place, findings in by_place(diagnosis).items():
        names = list(dict.fromkeys(map(name_text, findings)))
        found.setdefault(frozenset(names), (joined(names), []))[1].append(place)
    return [f"{names} at {joined(places)}" for names, places in found.values()]
