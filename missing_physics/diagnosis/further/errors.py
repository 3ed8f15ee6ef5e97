"""Errors and series of further sensors, from the residuals that hypotheses leave of each recording."""

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
    """Channels of which more is left than noise and the error of any model, largest share first.

    Args:
        data: the rows.
        every: residual of each fitted recording, shape (K, m) each.

    Yields:
        Number of the channel, rms that is left, level of the noise, share of the whitened energy of all
        channels, and significance.
    """
    floor = np.maximum(np.hypot(data.noise, data.error), np.finfo(float).tiny)
    parts = [_part(data, every, k, seen=True) for k in range(floor.size)]
    rms = np.array([_rms(part) for part in parts])
    energy = (rms / floor) ** 2
    for k in np.argsort(-energy):
        p_value = p_value_of(parts[k], float(floor[k]))
        if p_value < BEYOND_NOISE:
            yield int(k), float(rms[k]), float(floor[k]), float(energy[k] / energy.sum()), p_value


def errors_of(data: Data, every: Sequence[Array], k: int) -> Errors:
    """rms of the residual of one channel in all recordings."""
    return Errors(*(_rms(_part(data, every, k, seen=seen)) for seen in (True, False)))


def fits_of(
    data: Data, channels: Sequence[Channel], before: Sequence[Array], after: Sequence[Array]
) -> dict[str, ChannelFit]:
    """Errors by channel, of each recording's residual without and with what was found."""
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
        measured, before, after: what was measured of each recording, and its residual without and with
            what was found, shape (K, m) each.
        shown: the source of a recording, and what else is known of a channel in it (`ChannelSeries`).
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


def _part(data: Data, every: Sequence[Array], k: int, *, seen: bool) -> Array:
    """What is left of a channel in rows that are fitted, or in the others that are compared."""
    return np.concatenate(
        [left[data.counted(i)[:, k] & (data.fitted_rows(i) == seen), k] for i, left in enumerate(every)]
    )


def _rms(part: Array) -> float:
    return float(np.sqrt(np.mean(part**2)))
