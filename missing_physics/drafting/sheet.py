"""`Draft`: guesses about a log and the robot's drives."""

from __future__ import annotations

from dataclasses import dataclass, field

from missing_physics.drafting.channels import Entry, UnusedColumn
from missing_physics.drafting.clock import Clock
from missing_physics.drafting.drive import JointDraft
from missing_physics.drafting.text import map_text, overlay_text

__all__ = ["Draft"]


@dataclass
class Draft:
    """The result of `draft`.

    Attributes:
        clock: source of the time.
        entries: channels.
        unused: columns that are not read.
        joints: joint properties that the robot file lacks.
        notes: corrections, and checks that were not possible.
        source: name of the log for messages.
    """

    clock: Clock
    entries: list[Entry]
    unused: list[UnusedColumn]
    joints: list[JointDraft] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    source: str = ""

    @property
    def map(self) -> str:
        """The map, in TOML."""
        return map_text(self.source, self.clock, self.entries, self.unused)

    @property
    def overlay(self) -> str:
        """The overlay, in TOML; empty if it has no content."""
        return overlay_text(self.source, self.joints)

    @property
    def questions(self) -> int:
        """Number of open questions."""
        of_channels = sum(len(entry.questions) for entry in self.entries)
        return len(self.clock.questions) + of_channels + sum(len(joint.questions) for joint in self.joints)
