"""The first table of an answer: held-out errors of robot, standard model and answer by joint."""

from __future__ import annotations

from collections.abc import Sequence

from missing_physics.reporting.elements.formatting import number
from missing_physics.results.result import Diagnosis, Timing

__all__ = [
    "EXPENDABLE",
    "HEADINGS",
    "NUMBERS",
    "comparison_note",
    "comparison_rows",
    "named_channel",
    "timing_lines",
]

HEADINGS = ("", "nominal", "standard", "answer", "noise", "")
#: Columns of numbers.
NUMBERS = (1, 2, 3, 4)
#: Columns that a narrow terminal does without, the first to go first: noise, nominal.
EXPENDABLE = (4, 1)


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
    """What the table lacks, or why the robot file does not hold the answer; empty where all is there.

    Of an answer that is worse as a whole the verdict says so.
    """
    told_above = diagnosis.findings and diagnosis.comparison.written in ("standard", "nominal")
    return "" if told_above else diagnosis.comparison.words


def named_channel(channel: str) -> str:
    """``joint1`` of ``joint1.torque``, whose torque is meant; other channels by their whole name."""
    place, _, quantity = channel.rpartition(".")
    return place if quantity == "torque" else channel


def timing_lines(diagnosis: Diagnosis) -> list[str]:
    """Offsets between channels that are a matter of recording, in one line; none where there are none.

    Only what all joints share is told as timing, so that channels of one quantity belong together.
    """
    undone = {one.channel for one in diagnosis.timing if one.undone}
    found: dict[tuple[str, bool], list[Timing]] = {}
    for one in diagnosis.timing:
        quantity = one.channel.partition(" of ")[0]
        found.setdefault((quantity, not one.recording and quantity in undone), []).append(one)
    told = "; ".join(_late(quantity, group, more) for (quantity, more), group in found.items())
    return [f"Timing: {told}; this is not missing physics."] if told else []


def _late(quantity: str, group: Sequence[Timing], more: bool) -> str:
    """``torque is 0.52 samples (2.1 ms) late, which was corrected``.

    `more` where it was found in what had been moved already, and comes on top.
    """
    early = all(one.samples < 0.0 for one in group)
    sign = -1.0 if early else 1.0
    samples = [sign * one.samples for one in group]
    low, high = min(samples), max(samples)
    span = f"{low:.2f}" if high - low < 0.05 else f"{low:.2f} to {high:.2f}"
    size = sign * 1e3 * sum(one.offset for one in group) / len(group)
    undone = ", which was corrected" if any(one.undone for one in group) else ""
    what = "early" if early else "late"
    return f"{quantity} is {'another ' if more else ''}{span} samples ({size:.2g} ms) {what}{undone}"
