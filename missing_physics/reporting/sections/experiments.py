"""What to record next."""

from __future__ import annotations

from missing_physics.reporting.elements.formatting import effect_title, joined
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import Result
from robot_model import Robot

__all__ = ["section"]


def section(result: Result, robot: Robot) -> Section | None:
    """One item per experiment; None when there is none."""
    items = [
        {
            "separates": joined([effect_title(effect) for effect in experiment.separates], "from"),
            "do": experiment.do,
            "why": experiment.why,
            "motion": experiment.motion,
        }
        for experiment in result.diagnosis.experiments
    ]
    if not items:
        return None
    return Section(anchor="experiments", heading="Next experiments", values={"items": items})
