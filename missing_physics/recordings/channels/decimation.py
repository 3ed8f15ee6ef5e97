"""Decimation of a recording, with an anti-alias filter.

The filter is of finite length and symmetric, so that it has no delay; it passes frequencies below 0.8 of half
the new rate and attenuates by 80 dB from half the new rate on (Kaiser window). It is the same for all
channels, so that they remain consistent with each other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.signal import firwin, resample_poly

from missing_physics.recordings.channels.estimates import sample_time_of
from robot_model import InputError, Recording

__all__ = ["PASSES", "decimated", "decimation_of"]

Array = NDArray[np.float64]

#: Filter: passband and middle of the edge as fractions of half the new rate, and length [new samples].
PASSES, EDGE, LENGTH = 0.8, 0.9, 26
#: Shape parameter of the Kaiser window, for an attenuation of 80 dB.
BETA = 7.86
#: A gap of more than this many sampling times cuts a recording, and is kept.
GAP = 10.0
#: Relative jitter of the sampling time above which samples are first interpolated onto even instants.
JITTER = 1e-3
FEWEST = 4


def decimation_of(recording: Recording, most: int, *, rate: float | None = None) -> int:
    """Decimation factor.

    Args:
        recording: the one that is too long.
        most: largest number of samples.
        rate: wanted rate instead [Hz], to the nearest integer factor.

    Raises:
        InputError: at the wanted rate there are more than `most`.
    """
    count, own = len(recording), recording.sample_rate
    if rate is None:
        return max(1, -(-count // most))
    factor = max(1, round(own / rate))
    if count > most * factor:
        raise InputError(
            f"{recording.source or 'the recording'} has {count // factor} samples at {own / factor:.4g} Hz, "
            f"and at most {most} are taken; give a rate below {own * most / count:.3g} Hz, or cut it."
        )
    return factor


def decimated(recording: Recording, factor: int) -> Recording:
    """The filtered recording with every `factor`-th sample.

    A channel with a separate clock that is slower than the new rate keeps its values and noise; each value is
    interpolated at the nearest new instant. For other channels, stated noise and resolution become the noise
    after the filter.
    """
    if factor <= 1:
        return recording
    taps = np.asarray(firwin(LENGTH * factor + 1, EDGE / factor, window=("kaiser", BETA)))
    period = float(np.median(np.diff(recording.time)))
    cuts = np.flatnonzero(np.diff(recording.time) > GAP * period) + 1
    parts = [p for p in np.split(np.arange(len(recording)), cuts) if p.size > FEWEST * factor]
    if not parts:
        raise InputError(
            f"{recording.source or 'the recording'} is cut by gaps into parts of less than {FEWEST * factor} "
            "samples, too short to keep fewer per second; cut it."
        )
    grids = [_grid(recording.time[part], period) for part in parts]
    time = np.concatenate([grid[::factor] for grid in grids])
    channels = {}
    for name, values in recording.channels.items():
        made = [_kept(recording.time[p], values[p], g, factor, taps) for p, g in zip(parts, grids)]
        channels[name] = np.concatenate(made)
    left, noise = float(np.sqrt(np.sum(taps**2))), {}
    for name in sorted({*recording.noise, *recording.resolution} & recording.channels.keys()):
        white, step = recording.noise.get(name, 0.0), recording.resolution.get(name, 0.0)
        slow = sample_time_of(recording.time, np.isfinite(recording[name])) > factor * period
        noise[name] = float(np.hypot(white, step / np.sqrt(12.0))) * (1.0 if slow else left)
    steps = dict.fromkeys(noise, 0.0)
    return replace(recording, time=time, channels=channels, noise=noise, resolution=steps)


def _filtered(series: Array, factor: int, taps: Array) -> Array:
    """Filtered and decimated by `factor`; a series is extended by reflection at its ends."""
    pad = factor * (min(taps.size, series.size - 1) // factor)
    before, after = series[pad:0:-1], series[-2 : -pad - 2 : -1]
    whole = np.concatenate([2 * series[0] - before, series, 2 * series[-1] - after])
    count = -(-series.size // factor)
    return np.asarray(resample_poly(whole, 1, factor, window=taps))[pad // factor :][:count]


def _grid(time: Array, period: float) -> Array:
    """Even instants over a stretch."""
    return np.linspace(time[0], time[-1], max(2, round((time[-1] - time[0]) / period) + 1))


def _kept(time: Array, values: Array, grid: Array, factor: int, taps: Array) -> Array:
    """One channel over one stretch, at every `factor`-th of the even instants."""
    good = np.isfinite(values)
    at = grid[::factor]
    if good.sum() < FEWEST:
        return np.full(at.size, np.nan)
    own = sample_time_of(time, good)
    if own > at[1] - at[0]:
        places = np.unique(
            np.clip(np.round((time[good] - at[0]) / (at[1] - at[0])).astype(int), 0, at.size - 1)
        )
        kept = np.full(at.size, np.nan)
        places = places[(at[places] >= time[good][0]) & (at[places] <= time[good][-1])]
        kept[places] = make_interp_spline(time[good], values[good], k=3)(at[places])
        return kept
    even = grid.size == time.size and np.abs(grid - time).max() < JITTER * (grid[1] - grid[0])
    series = values if even and good.all() else np.interp(grid, time[good], values[good])
    kept = _filtered(series, factor, taps)
    if not good.all():
        after = np.clip(np.searchsorted(time[good], at), 1, int(good.sum()) - 1)
        before, behind = time[good][after - 1], time[good][after]
        bridged = behind - before > GAP * max(own, float(grid[1] - grid[0]))
        kept[bridged & (at > before) & (at < behind)] = np.nan
    return kept
