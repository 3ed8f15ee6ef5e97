"""The first table of an answer: held-out errors of nominal robot, standard model and answer, joint by joint."""

from __future__ import annotations

from collections.abc import Sequence

from missing_physics.diagnosis.result import Diagnosis
from missing_physics.reporting.formatting import number

__all__ = ["HEADINGS", "comparison_note", "comparison_rows", "named_channel"]

HEADINGS = ("", "nominal", "standard", "answer", "noise", "")


def comparison_rows(diagnosis: Diagnosis) -> list[Sequence[str]]:
    """One row per channel: place, four held-out rms, unit; empty where nothing was compared."""
    return [
        (
            named_channel(channel),
            number(one.nominal.validation_rms),
            number(None if one.standard is None else one.standard.validation_rms),
            number(one.answer.validation_rms),
            number(one.noise),
            one.unit,
        )
        for channel, one in diagnosis.comparison.channels.items()
    ]


def comparison_note(diagnosis: Diagnosis) -> str:
    """What the table lacks, or why the robot file does not hold the answer; empty where all is there."""
    return diagnosis.comparison.words


def named_channel(channel: str) -> str:
    """``joint1`` of ``joint1.torque``, whose torque is meant; other channels by their whole name."""
    place, _, quantity = channel.rpartition(".")
    return place if quantity == "torque" else channel
