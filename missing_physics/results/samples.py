"""Samples in which robot files are compared with a recording: those of the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation import Band
from missing_physics.standard import Sample

__all__ = ["Rows", "fitted_channels"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Rows:
    """Samples of one recording.

    Attributes:
        channels: those that are compared, m in number.
        noise: rms due to noise alone in each channel, shape (m,).
        time: [s], shape (K,).
        held_out: samples that were not fitted, shape (K,).
        counted: samples in which a channel is compared, those in which its joint moves, shape (K, m).
        band: frequency band.
        error: unavoidable rms of any model in each channel, shape (m,); none where it is not known.
    """

    channels: tuple[str, ...]
    noise: Array
    time: Array
    held_out: Mask
    counted: Mask
    band: Band
    error: Array | None = None

    @property
    def floor(self) -> dict[str, float]:
        """rms in each channel below which errors are not significant."""
        sizes = self.noise if self.error is None else np.hypot(self.noise, self.error)
        return dict(zip(self.channels, map(float, sizes)))

    @property
    def sample(self) -> Sample:
        """The same samples in the form that the standard model takes."""
        torques = [(c.removesuffix(".torque"), k) for k, c in enumerate(self.channels) if ".torque" in c]
        counted = {joint: self.counted[:, k] for joint, k in torques}
        return Sample(self.time, counted, self.band.torque, self.band.motion)

    @property
    def windows(self) -> tuple[tuple[float, float], ...]:
        """Time intervals that were not fitted [s]."""
        steps = np.flatnonzero(np.diff(np.concatenate([[0], self.held_out.astype(int), [0]])))
        return tuple((float(self.time[a]), float(self.time[b - 1])) for a, b in zip(steps[::2], steps[1::2]))


def fitted_channels(rows: Sequence[Rows]) -> frozenset[str]:
    """Channels with at least one counted fitted sample."""
    return frozenset(
        channel
        for own in rows
        for k, channel in enumerate(own.channels)
        if (own.counted[:, k] & ~own.held_out).any()
    )
