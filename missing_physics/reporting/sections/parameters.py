"""The nominal robot's parameters, re-estimated together with the findings."""

from __future__ import annotations

from missing_physics.reporting.elements.formatting import interval_text, number
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import ParameterChange, Result
from robot_model import Robot

__all__ = ["section"]


def section(result: Result, robot: Robot) -> Section | None:
    """One row per parameter that the recordings determine; None when there is none."""
    rows = [_row(change) for change in result.diagnosis.nominal_parameters if change.narrowed]
    if not rows:
        return None
    return Section(anchor="parameters", heading="Nominal parameters, re-estimated", values={"rows": rows})


def _row(change: ParameterChange) -> dict[str, object]:
    relative = change.estimate / change.nominal - 1 if change.nominal else float("nan")
    return {
        "name": change.name,
        "unit": change.unit,
        "nominal": number(change.nominal, 4),
        "shown": interval_text(change.estimate, change.ci95),
        "change": f"{100 * relative:+.1f} %" if abs(relative) < 10 else "–",
        "moved": change.moved,
        "note": change.note,
    }
