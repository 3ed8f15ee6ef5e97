"""Units of an effect's parameters at its place."""

from __future__ import annotations

import re

__all__ = ["CHANNEL_UNIT", "unit_at"]

#: Placeholder in a sensor effect's units for the unit of its channel.
CHANNEL_UNIT = "channel"

_TORQUE = re.compile(r"\bN m\b(?!\^)")
_ANGLE = re.compile(r"\brad\b")
_CHANNEL = re.compile(rf"\b{CHANNEL_UNIT}\b")


def unit_at(unit: str, *, prismatic: bool = False, channel_unit: str | None = None) -> str:
    """The unit of a parameter at a place.

    Args:
        unit: as the effect states it, for a revolute joint, such as `N m s/rad`.
        prismatic: the joint is prismatic: N m becomes N, rad becomes m.
        channel_unit: unit of the channel a sensor effect sits at; None leaves the word `channel`.
    """
    if channel_unit is not None:
        unit = _CHANNEL.sub(channel_unit, unit)
    return _ANGLE.sub("m", _TORQUE.sub("N", unit)) if prismatic else unit
