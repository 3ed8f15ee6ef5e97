"""What could not be determined."""

from __future__ import annotations

from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import Result
from robot_model import Robot

__all__ = ["section"]


def section(result: Result, robot: Robot) -> Section:
    """The list, or the statement that everything could be determined."""
    return Section(
        anchor="limits",
        heading="What could not be determined",
        values={"items": list(result.diagnosis.could_not_tell)},
    )
