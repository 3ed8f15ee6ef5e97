"""`Finding`: one result of a check of a recording."""

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
        sentence: message to the user; that of an error states the correction.
        numbers: measured values on which it is based.
        corrections: changes of the map that correct it, if known.
    """

    severity: Severity
    kind: str
    channel: str
    sentence: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    corrections: tuple[Correction, ...] = ()
