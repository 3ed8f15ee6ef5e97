"""`Finding`: one thing that a check saw in a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from missing_physics.recordings.maps.corrections import Correction

__all__ = ["Finding", "Severity"]

#: `error`: unusable as it is; `warning`: may mislead a diagnosis; `note`: worth knowing.
Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """One result of a check.

    Attributes:
        severity: see `Severity`.
        kind: short name of the kind of problem, e.g. ``gap``.
        channel: the native channel, or ``time``.
        sentence: for people; an error's says how to correct it.
        numbers: measured values on which it rests.
        corrections: changes of the map that correct it, where they are known.
    """

    severity: Severity
    kind: str
    channel: str
    sentence: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    corrections: tuple[Correction, ...] = ()
