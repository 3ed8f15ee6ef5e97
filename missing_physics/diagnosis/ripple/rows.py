"""One recording's rows above the band of the motion: torques filtered and thinned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.ripple.series import Fast
from missing_physics.diagnosis.ripple.whitening import Whitening
from missing_physics.diagnosis.ripple.zeros import zeros_of
from missing_physics.evaluation.band import SPOILED_PERIODS
from missing_physics.hypotheses import Sight
from missing_physics.standard.normal import Places

__all__ = ["PER_PERIOD", "Rows", "about_zeros"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Rows kept per period of the band's upper end.
PER_PERIOD = 2.5
#: Relative rounding of a ratio of sampling rates.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Rows:
    """K rows of N samples, n joints.

    Attributes:
        own: the recording.
        filters: of each joint; None where nothing is compared.
        high: upper end of the band [Hz].
    """

    own: Fast
    filters: tuple[Whitening | None, ...]
    high: float

    @cached_property
    def kept(self) -> slice:
        """Samples that are rows."""
        motion = self.own.motion
        edge = int(SPOILED_PERIODS * motion.rate / self.own.slow)
        stride = max(1, int(motion.rate / (PER_PERIOD * self.high) * (1.0 + ROUNDING)))
        return slice(edge, max(edge, motion.time.size - edge), stride)

    @cached_property
    def mask(self) -> Mask:
        """Which rows are compared, shape (K, n)."""
        return np.asarray(self.own.known[self.kept] & [one is not None for one in self.filters])

    @cached_property
    def target(self) -> Array:
        """Filtered residuals, zero where nothing is compared, shape (K, n) [N m or N]."""
        residual = self.own.residual
        return self.reduced(residual[:, :, None], np.arange(residual.shape[1]))[:, :, 0]

    @cached_property
    def design(self) -> Array:
        """Derivatives by a relative error of the inertia at each joint, shape (K, n, n)."""
        motion, count = self.own.motion, len(self.filters)
        found = np.zeros((len(motion.time[self.kept]), count, count))
        for k, white in enumerate(self.filters):
            if white is not None:
                column = self.own.inertial[:, k] * motion.shares[:, k]
                found[:, k, k] = white.of_column(column, motion.rate)[self.kept] * self.mask[:, k]
        return found

    def reduced(self, values: Array, places: Places) -> Array:
        """Torques at some joints, (N, a, C), filtered, in the rows, zero where nothing is compared."""
        motion = self.own.motion
        found = np.zeros((len(motion.time[self.kept]), *values.shape[1:]))
        for i, k in enumerate(places):
            white = self.filters[k]
            if white is not None:
                found[:, i] = white(values[:, i] * motion.shares[:, k, None], motion.rate)[self.kept]
        return found * self.mask[:, places, None]

    def sight(self, k: int, residual: Array, ratio: float) -> Sight:
        """What the starting values of effects at one joint are read from.

        Args:
            k: number of the joint.
            residual: of a fit at that joint, shape (K,).
            ratio: of its gear [-].
        """
        motion, kept = self.own.motion, self.kept
        return Sight(
            time=motion.time[kept],
            position=self.own.position[kept, k],
            velocity=motion.velocity[kept, k],
            torque=self.own.torque[kept, k],
            residual=residual,
            step=1.0 / motion.rate,
            cutoff=self.high,
            gear_ratio=ratio,
        )


def about_zeros(every: Sequence[Rows]) -> tuple[Rows, ...]:
    """The same rows with positions about the encoder zeros of the first recording."""
    zeros = np.zeros((len(every), len(every[0].filters)))
    for k, white in enumerate(every[0].filters):
        if white is not None:
            zeros[:, k] = zeros_of([one.sight(k, one.target[:, k], 1.0) for one in every], white.level**2)
    return tuple(replace(one, own=replace(one.own, zeros=zero)) for one, zero in zip(every, zeros))
