"""Channels that are predicted, and what a term adds to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Contribution", "Output"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Output:
    """A channel that is predicted along the recorded joint motion.

    Attributes:
        channel: e.g. ``joint1.torque``.
        place: e.g. ``joint1``.
        joint: which moving joint it belongs to; None for the base.
    """

    channel: str
    place: str
    joint: int | None


@dataclass(frozen=True)
class Contribution:
    """What a term adds to the predicted outputs, on the kept rows.

    Attributes:
        value: shape (M, m).
        jacobian: derivative by the term's free parameters, shape (M, m, k).
    """

    value: Array
    jacobian: Array
