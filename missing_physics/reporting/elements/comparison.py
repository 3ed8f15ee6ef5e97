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
#: Columns that are left out on a narrow terminal, in this order: noise, nominal.
EXPENDABLE = (4, 1)


def comparison_rows(diagnosis: Diagnosis) -> list[Sequence[str]]:
    """One row per channel: place, four held-out rms, unit; empty if nothing was compared."""
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
    """What is missing in the table, or why the robot file does not hold the answer; else empty.

    An answer that is worse over all channels is mentioned in the verdict instead.
    """
    in_verdict = diagnosis.findings and diagnosis.comparison.written in ("standard", "nominal")
    return "" if in_verdict else diagnosis.comparison.words


def named_channel(channel: str) -> str:
    """``joint1`` for ``joint1.torque``; other channels by their full name."""
    place, _, quantity = channel.rpartition(".")
    return place if quantity == "torque" else channel


def timing_lines(diagnosis: Diagnosis) -> list[str]:
    """Time offsets between channels due to the recording, in one line; empty if there are none.

    Only offsets shared by all joints are reported as timing, so channels of one quantity belong together.
    """
    undone = {one.channel for one in diagnosis.timing if one.undone}
    found: dict[tuple[str, bool], list[Timing]] = {}
    for one in diagnosis.timing:
        quantity = one.channel.partition(" of ")[0]
        found.setdefault((quantity, not one.recording and quantity in undone), []).append(one)
    text = "; ".join(_late(quantity, group, more) for (quantity, more), group in found.items())
    return [f"Timing: {text}; this is not missing physics."] if text else []


def _late(quantity: str, group: Sequence[Timing], more: bool) -> str:
    """``torque is 0.52 samples (2.1 ms) late, which was corrected``.

    `more`: the delay is additional, found in channels that had already been shifted.
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
