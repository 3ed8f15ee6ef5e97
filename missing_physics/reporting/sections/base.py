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
    """One section: its anchor, heading, template, and what the template shows.

    Attributes:
        anchor: identifier in the page; also the name of the template, ``ANCHOR.html``.
        heading: for people.
        values: read in the template as `s`.
        figures: read in the template as `figures`.
    """

    anchor: str
    heading: str
    values: Mapping[str, Any] = field(default_factory=dict)
    figures: Sequence[Figure] = ()


class Maker(Protocol):
    """Every module of this package has such a function named `section`."""

    def __call__(self, result: Result, robot: Robot) -> Section | None:
        """The section, or None when the result holds nothing for it."""
