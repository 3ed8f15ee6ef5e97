"""`Draft`: what was guessed of a log and of the drives that it shows."""

from __future__ import annotations

from dataclasses import dataclass, field

from missing_physics.drafting.channels import Entry, Left
from missing_physics.drafting.clock import Clock
from missing_physics.drafting.drive import JointDraft
from missing_physics.drafting.text import map_text, overlay_text

__all__ = ["Draft"]


@dataclass
class Draft:
    """What `draft` found.

    Attributes:
        clock: how time is made.
        entries: channels.
        left: columns that are not read.
        joints: what the robot file lacks.
        notes: what was corrected, or could not be weighed.
        source: the log, for people.
    """

    clock: Clock
    entries: list[Entry]
    left: list[Left]
    joints: list[JointDraft] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    source: str = ""

    @property
    def map(self) -> str:
        """The map, in TOML."""
        return map_text(self.source, self.clock, self.entries, self.left)

    @property
    def overlay(self) -> str:
        """The overlay, in TOML; empty where there is nothing to say."""
        return overlay_text(self.source, self.joints)

    @property
    def questions(self) -> int:
        """How many remain."""
        of_channels = sum(len(entry.questions) for entry in self.entries)
        return len(self.clock.questions) + of_channels + sum(len(joint.questions) for joint in self.joints)
