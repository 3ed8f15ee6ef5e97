"""A section of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from missing_physics.reporting.elements.figures import Figure
from missing_physics.results.result import Result
from robot_model import Robot

__all__ = ["Maker", "Section"]


@dataclass(frozen=True)
class Section:
    """One section: its anchor, heading, template, and the template's content.

    Attributes:
        anchor: identifier in the page; also the name of the template, ``ANCHOR.html``.
        heading: displayed heading.
        values: read in the template as `s`.
        figures: read in the template as `figures`.
    """

    anchor: str
    heading: str
    values: Mapping[str, Any] = field(default_factory=dict)
    figures: Sequence[Figure] = ()


class Maker(Protocol):
    """Interface of the function `section` in every module of this package."""

    def __call__(self, result: Result, robot: Robot) -> Section | None:
        """The section, or None if the result has no content for it."""
