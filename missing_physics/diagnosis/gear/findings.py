"""Translation of hypotheses on gaps into findings, and the names of their channels."""

from __future__ import annotations

from missing_physics.diagnosis.further.errors import Channel
from missing_physics.diagnosis.further.findings import Key, Reading
from missing_physics.diagnosis.gear.data import GapData
from missing_physics.diagnosis.gear.laws import keys_of, parameters_of
from reference_model.effects.base import Parameter

__all__ = ["channels_of", "reading_of"]


def channels_of(data: GapData) -> list[Channel]:
    """The channels of the gaps."""
    return [
        Channel(f"{gap.joint}.position - {gap.joint}.motor_position", gap.unit, gap.joint)
        for gap in data.gaps[0]
    ]


def reading_of(data: GapData) -> Reading:
    """How terms on gaps translate into findings: each is visible in the gap of one joint."""

    def channels(key: Key) -> list[int]:
        place = key[1].split(".")[0]
        return [k for k, gap in enumerate(data.gaps[0]) if place in (gap.joint, gap.link)]

    def unit(key: Key, p: Parameter) -> str:
        slides = data.gaps[0][channels(key)[0]].is_prismatic
        return p.unit.replace("N m", "N").replace("rad", "m") if slides else p.unit

    return Reading(channels, keys_of, parameters_of, unit)
