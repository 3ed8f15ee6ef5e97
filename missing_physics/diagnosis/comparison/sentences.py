"""Sentences of the comparison for the user."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from missing_physics.diagnosis.comparison.choice import Choice
from missing_physics.results.comparison import AT_NOISE
from missing_physics.results.result import Fit
from missing_physics.results.samples import Rows

__all__ = [
    "BEYOND_A_FILE",
    "NAMED_BY_STANDARD",
    "NUMBERS_ARE_OFF",
    "PREDICTED_BETTER",
    "choice_sentence",
    "no_comparison",
    "remaining_errors",
]

#: Channels whose remaining error is reported: those farthest above the noise.
MOST = 3

#: Note on findings at a joint that the standard model predicts better.
PREDICTED_BETTER = "The standard model predicts this joint better."
BEYOND_A_FILE = "No standard model: a robot file cannot hold its parameters, so it cannot be evaluated."
NAMED_BY_STANDARD = (
    "All effects found are part of the standard model, whose parameters predict held-out data better: the "
    "robot file has these parameters."
)
NUMBERS_ARE_OFF = (
    "No effect needs to be missing: masses, inertias or friction other than the robot file's predict the "
    "recordings, and the written file has them. A load or drive missing in the file may look the same."
)
OVERALL = {
    "standard": (
        "On data that were not fitted the answer predicts worse than the standard model, so nothing of it "
        "is proven and the robot file holds the standard model."
    ),
    "nominal": (
        "On data that were not fitted the answer predicts worse than the nominal robot file, so nothing of "
        "it is proven and the robot file is as it was."
    ),
}
OF_JOINTS = {
    "standard_friction": "the robot file has the standard model's friction there",
    "standard_bodies": "the robot file has the standard model's masses and inertias",
    "standard": "the robot file holds the standard model",
}


def no_comparison(rows: Sequence[Rows]) -> str:
    """Why there is no comparison with the standard model."""
    if not rows:
        return "No standard model: these recordings do not contain enough data."
    return "No standard model: the robot file cannot be evaluated along these recordings."


def choice_sentence(choice: Choice) -> str:
    """Why the robot file does not hold the answer; empty if it does."""
    if choice.written == "answer":
        return ""
    if choice.overall:
        return OVERALL[choice.written]
    where = ", ".join(channel.split(".")[0] for channel in choice.worse)
    return f"At {where} the standard model predicts held-out data better: {OF_JOINTS[choice.written]}."


def remaining_errors(fit: Fit, floor: Mapping[str, float]) -> Iterator[str]:
    """Remaining errors on held-out data, in the channels farthest above the floor of any model.

    Args:
        fit: errors of all channels.
        floor: rms by channel below which errors are not significant; by default the noise.
    """
    least = np.finfo(float).eps
    levels = {name: max(one.noise_floor, floor.get(name, 0.0), least) for name, one in fit.channels.items()}
    above = [
        (one.after.validation_rms / levels[name], name, one)
        for name, one in fit.channels.items()
        if one.after.validation_rms > AT_NOISE * levels[name]
    ]
    for _, name, one in sorted(above, key=lambda item: -item[0])[:MOST]:
        share, before, after = (
            "more than with the robot file",
            one.before.validation_rms,
            one.after.validation_rms,
        )
        if after < before:
            share = f"{(after / before) ** 2:.1%} of the mismatch energy"
        yield (
            f"{name}: {after:.3g} {one.unit} rms remain on data that were not fitted, "
            f"{share} (noise {one.noise_floor:.2g} {one.unit})."
        )
