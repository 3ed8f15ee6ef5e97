"""Common parts of several controllers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from pydantic import Field

from robot_model.input.fields import Description, NonNegative

__all__ = ["Reading", "Sampled", "numbers", "positive"]


class Reading(Description):
    """Which encoders a controller reads."""

    feedback: Literal["motor", "joint"] = Field(
        default="motor",
        description="encoder used to control a joint with an elastic gear or with play; for other joints "
        "both are the same",
    )


class Sampled(Reading):
    """How often a controller computes."""

    sample_time: NonNegative = Field(
        default=0.0, description="zero-order hold of the output; 0 is continuous [s]"
    )


def numbers(gains: float | tuple[float, ...]) -> tuple[float, ...]:
    """The values of a gain, one for all moving joints or one for each."""
    return gains if isinstance(gains, tuple) else (gains,)


def positive(controller: Description, keys: Iterable[str]) -> None:
    """Raise `ValueError` for a gain of these keys that is not positive, with key and value."""
    for key in keys:
        for number in numbers(getattr(controller, key)):
            if number <= 0:
                raise ValueError(f"{key} is {number:g}; it must be positive")
