"""Errors and series of further sensors, from the residuals of hypotheses in each recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.answer.locate import BEYOND_NOISE, p_value_of
from missing_physics.inference import Data
from missing_physics.results.result import ChannelFit, ChannelSeries, Errors

__all__ = ["Channel", "beyond_noise", "errors_of", "fits_of", "series_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """Name, unit and place of a channel."""

    name: str
    unit: str
    location: str


def beyond_noise(data: Data, every: Sequence[Array]) -> Iterator[tuple[int, float, float, float, float]]:
    """Channels whose residual exceeds noise and the error of any model, largest share first.

    Args:
        data: the rows.
        every: residual of each fitted recording, shape (K, m) each.

    Yields:
        Number of the channel, rms residual, level of the noise, fraction of the whitened energy of all
        channels, and p-value.
    """
    floor = np.maximum(np.hypot(data.noise, data.error), np.finfo(float).tiny)
    parts = [_part(data, every, k, fitted=True) for k in range(floor.size)]
    rms = np.array([_rms(part) for part in parts])
    energy = (rms / floor) ** 2
    for k in np.argsort(-energy):
        p_value = p_value_of(parts[k], float(floor[k]))
        if p_value < BEYOND_NOISE:
            yield int(k), float(rms[k]), float(floor[k]), float(energy[k] / energy.sum()), p_value


def errors_of(data: Data, every: Sequence[Array], k: int) -> Errors:
    """rms of the residual of one channel in all recordings."""
    return Errors(*(_rms(_part(data, every, k, fitted=fitted)) for fitted in (True, False)))


def fits_of(
    data: Data, channels: Sequence[Channel], before: Sequence[Array], after: Sequence[Array]
) -> dict[str, ChannelFit]:
    """Errors by channel, from each recording's residual without and with the findings."""
    return {
        one.name: ChannelFit(
            one.unit, errors_of(data, before, k), errors_of(data, after, k), float(data.noise[k])
        )
        for k, one in enumerate(channels)
    }


def series_of(
    data: Data,
    channels: Sequence[Channel],
    measured: Sequence[Array],
    before: Sequence[Array],
    after: Sequence[Array],
    shown: Callable[[int, int], Mapping[str, Any]],
) -> tuple[ChannelSeries, ...]:
    """Every channel in every recording.

    Args:
        data: the rows.
        channels: of them.
        measured, before, after: measured rows of each recording, and residuals without and with the
            findings, shape (K, m) each.
        shown: gives the further fields of `ChannelSeries` for a recording and a channel.
    """
    return tuple(
        ChannelSeries(
            role="train" if i < data.fitted else "validation",
            channel=one.name,
            unit=one.unit,
            location=one.location,
            time=data.time(i),
            measured=values[:, k],
            nominal=values[:, k] - before[i][:, k],
            augmented=values[:, k] - after[i][:, k],
            held_out=~data.fitted_rows(i),
            noise_floor=float(data.noise[k]),
            **shown(i, k),
        )
        for k, one in enumerate(channels)
        for i, values in enumerate(measured)
    )


def _part(data: Data, every: Sequence[Array], k: int, *, fitted: bool) -> Array:
    """Residual of a channel in the fitted rows, or in the other compared rows."""
    return np.concatenate(
        [
            residual[data.counted(i)[:, k] & (data.fitted_rows(i) == fitted), k]
            for i, residual in enumerate(every)
        ]
    )


def _rms(part: Array) -> float:
    return float(np.sqrt(np.mean(part**2)))
