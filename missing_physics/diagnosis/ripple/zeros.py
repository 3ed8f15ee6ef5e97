"""Zeros of encoders that count from where they were switched on, from the phase of a wave over position."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Sight, extent_of
from missing_physics.inference.ledger import ODDS

__all__ = ["zeros_of"]

Array = NDArray[np.float64]


def zeros_of(sights: Sequence[Sight], variance: float) -> Array:
    """What to add to each recording's positions to have them about the zero of the first one [rad or m].

    The strongest wave over position has one amplitude and phase in all recordings. Another zero is taken
    where the odds of a further parameter are outweighed.

    Args:
        sights: one joint in each recording; their residuals are white.
        variance: of the noise.
    """
    found = np.zeros(len(sights))
    orders = sorted({order for sight in sights for order in extent_of(sight).orders})
    if not orders:
        return found
    waves = np.array([[_wave(sight, order) for order in orders] for sight in sights])
    count = np.array([np.count_nonzero(sight.residual) for sight in sights], dtype=float)
    best = int(np.argmax(count @ np.abs(waves) ** 2))
    first, order = waves[0, best], orders[best]
    for i, own in enumerate(waves[:, best]):
        weight = count[0] * count[i] / max(count[0] + count[i], 1.0) / (4.0 * variance)
        if weight * (abs(own - first) ** 2 - (abs(own) - abs(first)) ** 2) > ODDS:
            found[i] = float(np.angle(first / own)) / order
    return found


def _wave(sight: Sight, order: float) -> complex:
    """Complex amplitude of a wave over position in the residual."""
    seen = sight.residual != 0.0
    if not seen.any():
        return 0.0
    return complex(2.0 * np.mean(sight.residual[seen] * np.exp(1j * order * sight.position[seen])))
