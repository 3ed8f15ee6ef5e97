"""The named physics: parameters with intervals, and rejected alternatives with reasons."""

from __future__ import annotations

from missing_physics.reporting.elements.formatting import (
    effect_of,
    effect_title,
    interval_text,
    parameter_title,
    percent,
    probability_text,
    rival_text,
    undetermined_text,
)
from missing_physics.reporting.elements.verdicts import by_place
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import Finding, Result
from robot_model import Robot

__all__ = ["section"]


def section(result: Result, robot: Robot) -> Section:
    """One block per finding, grouped by place; a sentence if there is none."""
    diagnosis = result.diagnosis
    together = [_finding(f) for found in by_place(diagnosis).values() for f in found]
    return Section(
        anchor="findings",
        heading="What the simulation leaves out",
        values={"verdict": diagnosis.verdict, "findings": together},
    )


def _finding(finding: Finding) -> dict[str, object]:
    effect = effect_of(finding.effect)
    return {
        "id": finding.effect,
        "title": effect_title(finding.effect),
        "location": finding.location,
        "probability": probability_text(finding.probability),
        "improvement": percent(finding.validation_improvement) if finding.validation_improvement else "",
        "equation": effect.equation if effect else "",
        "source": effect.source if effect else "",
        "note": finding.note,
        "undetermined": undetermined_text(finding),
        "ambiguous_with": [rival_text(rival, finding.location) for rival in finding.ambiguous_with],
        "parameters": [
            {
                "name": name,
                "meaning": parameter_title(finding.effect, name),
                "unit": estimate.unit,
                "shown": interval_text(estimate.value, estimate.ci95),
            }
            for name, estimate in finding.parameters.items()
            if estimate.narrowed
        ],
        "alternatives": [
            {
                "title": effect_title(other.effect),
                "location": other.location,
                "probability": probability_text(other.probability),
                "why_not": other.why_not,
            }
            for other in sorted(finding.alternatives, key=lambda item: -item.probability)
        ],
    }
