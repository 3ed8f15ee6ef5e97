"""What several controllers have in common."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from pydantic import Field

from robot_model.fields import Description, NonNegative

__all__ = ["Reading", "Sampled", "positive"]


class Reading(Description):
    """Which encoders a controller reads."""

    feedback: Literal["motor", "joint"] = Field(
        default="motor",
        description="which encoder a joint with an elastic gear or with play is controlled by; elsewhere "
        "both are the same",
    )


class Sampled(Reading):
    """How often a controller computes."""

    sample_time: NonNegative = Field(
        default=0.0, description="zero-order hold of the output; 0 is continuous [s]"
    )


def positive(controller: Description, keys: Iterable[str]) -> None:
    """Raise `ValueError` for a gain of these keys that is not above zero, with key and value."""
    for key in keys:
        value = getattr(controller, key)
        for number in value if isinstance(value, tuple) else (value,):
            if number <= 0:
                raise ValueError(f"{key} is {number:g}; it must be positive")
