"""What a comparison says, for people."""

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
    "left_over",
    "no_comparison",
    "of_choice",
]

#: Channels of which is said how much is left, those farthest above the noise.
MOST = 3

#: Said of names at a joint that the standard model predicts better.
PREDICTED_BETTER = "The standard model predicts this joint better."
BEYOND_A_FILE = "No standard model: a robot file cannot hold its numbers, so that it cannot be evaluated."
NAMED_BY_STANDARD = (
    "All that is named is in the standard model, whose numbers predict held-out data better: the robot file "
    "has these."
)
NUMBERS_ARE_OFF = (
    "No effect has to be missing: other masses, inertias or friction than the robot file's predict the "
    "recordings, and the written file has them. A load or drive that is not in the file may look alike."
)
OF_WHOLE = {
    "standard": (
        "On data that were not fitted the answer predicts worse than the standard model, so nothing of it "
        "is proven and the robot file holds the standard model."
    ),
    "nominal": (
        "On data that were not fitted the answer predicts worse than the robot as described, so nothing of "
        "it is proven and the robot file is as it was."
    ),
}
OF_JOINTS = {
    "standard_friction": "the robot file has the standard model's friction there",
    "standard_bodies": "the robot file has the standard model's masses and inertias",
    "standard": "the robot file holds the standard model",
}


def no_comparison(rows: Sequence[Rows]) -> str:
    """Why the standard model is not compared."""
    if not rows:
        return "No standard model: too little can be judged from these recordings."
    return "No standard model: the robot file cannot be evaluated along these recordings."


def of_choice(choice: Choice) -> str:
    """Why the robot file does not hold the answer; empty where it does."""
    if choice.written == "answer":
        return ""
    if choice.whole:
        return OF_WHOLE[choice.written]
    where = ", ".join(channel.split(".")[0] for channel in choice.worse)
    return f"At {where} the standard model predicts held-out data better: {OF_JOINTS[choice.written]}."


def left_over(fit: Fit, floor: Mapping[str, float]) -> Iterator[str]:
    """How much is left on data that were not fitted, in the channels farthest above what no model predicts.

    Args:
        fit: of all channels.
        floor: rms by channel below which errors are not significant; the noise where it is not stated.
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
