"""Samples at which the unexplained force is larger than usual: where a joint rests or turns round.

Friction of a joint that rests may be anything up to the break-away torque, and about a reversal no simple
law holds. The unexplained force has there ``1 + excess exp(-(v / speed)^2)`` times its usual variance, with
the two numbers under which the whitened residual is most likely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Unsure", "unsure"]

Array = NDArray[np.float64]

#: Speeds that are compared, as parts of the joint's largest one.
SPEEDS = (0.001, 0.003, 0.01, 0.03, 0.1)
#: Excess of variance that is compared: none, to one that leaves nothing of a row.
EXCESS = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 1e3, 1e4, 1e5)


@dataclass(frozen=True)
class Unsure:
    """Speed [rad/s or m/s] below which friction is unsure, and the excess of variance at rest [-]."""

    speed: float
    excess: float

    def variance(self, velocity: Array) -> Array:
        """Of the unexplained force over its usual variance, shape as `velocity`."""
        return np.asarray(1.0 + self.excess * np.exp(-((velocity / self.speed) ** 2)))


def unsure(white: Sequence[Array], velocity: Sequence[Array]) -> Unsure:
    """The most likely one for whitened residuals along velocities, one array for each recording."""
    residual, speed = np.concatenate(white), np.concatenate(velocity)
    top = float(np.abs(speed).max())
    best, found = -np.inf, Unsure(max(top, 1e-12) * SPEEDS[0], 0.0)
    for part in SPEEDS if top > 0.0 else ():
        for excess in EXCESS:
            trial = Unsure(part * top, excess)
            variance = trial.variance(speed)
            level = float(np.mean(residual**2 / variance))
            likelihood = -0.5 * float(np.log(variance).sum() + residual.size * np.log(max(level, 1e-300)))
            if likelihood > best + 1e-9:
                best, found = likelihood, trial
    return found
