"""The answer at the top: the verdict, effects and places, and the gain on held-out data."""

from __future__ import annotations

from missing_physics.reporting.elements.comparison import comparison_note, comparison_rows, timing_lines
from missing_physics.reporting.elements.formatting import effect_title, percent, probability_text
from missing_physics.reporting.elements.verdicts import (
    ABSENT,
    MOVED,
    TITLE,
    by_place,
    improvement_text,
    meaning,
    moved_texts,
    name_text,
    named_text,
    not_judged_text,
)
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import Diagnosis, Result
from robot_model import Robot

__all__ = ["section"]

#: Most parameters listed on the first screen; all are in a table further down.
MOST_MOVED = 5
#: With more findings than this the summary paragraph is folded: it repeats the list above it.
MOST_IN_WORDS = 4


def section(result: Result, robot: Robot) -> Section:
    """Verdict, three key numbers and the summary in plain words."""
    diagnosis, moved = result.diagnosis, moved_texts(result.diagnosis)
    return Section(
        anchor="verdict",
        heading="Verdict",
        values={
            "verdict": diagnosis.verdict,
            "title": TITLE[diagnosis.verdict],
            "meaning": meaning(diagnosis),
            "summary": diagnosis.summary,
            "named": named_text(diagnosis) + not_judged_text(diagnosis),
            "places": _places(diagnosis),
            "silent": not_judged_text(diagnosis).removeprefix("; "),
            "probabilities": _probabilities(diagnosis),
            "folded": len(diagnosis.findings) > MOST_IN_WORDS,
            "improvement": improvement_text(diagnosis),
            "improvement_note": _improvement_note(diagnosis),
            "moved_heading": MOVED,
            "moved": moved[:MOST_MOVED],
            "more_moved": max(len(moved) - MOST_MOVED, 0),
            "compared": comparison_rows(diagnosis),
            "comparison_note": comparison_note(diagnosis),
            "timing": timing_lines(diagnosis),
        },
    )


def _places(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Each place with its effects and their probabilities; empty if one line suffices."""
    found = by_place(diagnosis)
    if len(found) < 2 or diagnosis.verdict == "unexplained":
        return []
    return [
        (place, ", ".join(f"{name_text(f)} {probability_text(f.probability)}" for f in findings))
        for place, findings in found.items()
    ]


def _probabilities(diagnosis: Diagnosis) -> str:
    found = diagnosis.findings
    if len(found) == 1:
        return f"probability {probability_text(found[0].probability)}"
    if found:
        return ", ".join(f"{effect_title(f.effect)} {probability_text(f.probability)}" for f in found)
    shares = [m for m in diagnosis.mismatch if m.share > 0]
    return f"{percent(shares[0].share)} of the mismatch in {shares[0].channel}" if shares else ""


def _improvement_note(diagnosis: Diagnosis) -> str:
    if improvement_text(diagnosis) == ABSENT:
        return "no augmented model to compare"
    return "lower error on data that were not fitted"
