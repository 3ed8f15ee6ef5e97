"""Noise and resolution of channels, estimated from their values."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_model import Recording

__all__ = [
    "estimate_noise",
    "estimate_resolution",
    "interpolation_residual",
    "noise_of",
    "resolution_of",
    "rests_on_levels",
    "sample_time_of",
    "smallest_step",
]

Array = NDArray[np.float64]

#: Most samples that are used; of a longer recording, blocks spread over it.
MOST_SAMPLES = 200_000
#: Number of blocks in that case.
BLOCKS = 20
#: A normal distribution's standard deviation per median absolute deviation.
SIGMA_PER_MAD = 1.4826
#: Neighbours on each side from which a sample is predicted. Few predict fast motion poorly, many need
#: smooth motion over a longer stretch; the smallest residual is closest to the noise.
HALF_WIDTHS = (1, 2, 3)
#: A channel has a separate clock if it has a value at every second sample or less often, and evenly: fraction
#: of its steps that must be near the usual one, their tolerance, and the fewest values that suffice.
OWN_CLOCK, UNEVEN, MOSTLY, FEWEST = 1.5, 0.5, 0.9, 10
#: Part of the steps that must be whole multiples of the smallest for a channel to count as quantised.
WHOLE = 0.98
#: Largest deviation of a step from an integer multiple, in steps.
OFF_GRID = 0.05
#: Values between which the encoder of a resting joint flickers.
LEVELS_AT_REST = 3
#: Different steps from which the common divisor is taken.
FIRST_STEPS = 20
#: Largest usable multiple: beyond it, rounding of the smallest step dominates.
LARGEST_MULTIPLE = 1000.0


def estimate_noise(recording: Recording) -> dict[str, float]:
    """Standard deviation of the white noise in each channel, in its unit.

    Values stated in the recording take precedence. Otherwise every sample is predicted from its neighbours by
    the polynomial through them (Lagrange, at the actual instants, so jitter has no influence); the median
    absolute residual, scaled to a normal distribution and divided by sqrt(1 + sum of squared weights), is
    the noise. It is at least resolution/sqrt(12). Noise that was filtered before it was recorded is
    underestimated. A channel with too few numbers has NaN.
    """
    return {name: noise_of(recording, name) for name in recording}


def estimate_resolution(recording: Recording) -> dict[str, float]:
    """Smallest step of each channel, in its unit; channels that are not quantised are skipped.

    Values stated in the recording take precedence.
    """
    found = {name: resolution_of(recording, name) for name in recording}
    return {name: step for name, step in found.items() if step > 0}


def resolution_of(recording: Recording, channel: str) -> float:
    """Smallest step of one channel; 0 when it is not quantised or constant."""
    stated = recording.resolution.get(channel, 0.0)
    return stated or smallest_step(_thinned(recording.time, recording[channel])[1])


def rests_on_levels(values: Array) -> bool:
    """Whether a position has so few values that it may be at rest between two steps of its encoder."""
    return np.unique(values[np.isfinite(values)]).size <= LEVELS_AT_REST


def noise_of(recording: Recording, channel: str) -> float:
    """Noise of one channel; see `estimate_noise`."""
    stated = recording.noise.get(channel, 0.0)
    if stated:
        return stated
    time, values = recording.time, recording[channel]
    good = np.isfinite(values)
    # With a separate clock the neighbours are its existing values.
    if good.mean() < 0.5 or sample_time_of(time, good):
        time, values = time[good], values[good]
    time, values = _thinned(time, values)
    sigmas = [_sigma(time, values, half_width=k) for k in HALF_WIDTHS]
    finite = [sigma for sigma in sigmas if math.isfinite(sigma)]
    floor = resolution_of(recording, channel) / math.sqrt(12.0)
    return max(min(finite), floor) if finite else math.nan


def sample_time_of(time: Array, good: NDArray[np.bool_]) -> float:
    """Sampling time [s] of a channel with a separate clock; 0 if it has values at most instants.

    Args:
        time: [s], shape (N,).
        good: mask of its values, shape (N,).
    """
    at = np.flatnonzero(good)
    if at.size < FEWEST or float(np.median(np.diff(at))) < OWN_CLOCK:
        return 0.0
    steps = np.diff(time[at])
    usual = float(np.median(steps))
    return usual if float(np.mean(np.abs(steps - usual) < UNEVEN * usual)) > MOSTLY else 0.0


def interpolation_residual(time: Array, values: Array, *, half_width: int) -> Array:
    """Sample minus its prediction from `half_width` neighbours on each side, scaled to the noise.

    Args:
        time: [s], shape (N,).
        values: shape (N,).

    Returns:
        Shape (N - 2 half_width,); for white noise of standard deviation s, its standard deviation is s.
    """
    count = values.size - 2 * half_width
    if count <= 0:
        return np.zeros(0)
    offsets = [k for k in range(-half_width, half_width + 1) if k]
    here = time[half_width : half_width + count]
    nodes = {k: time[half_width + k : half_width + k + count] for k in offsets}
    residual = values[half_width : half_width + count].copy()
    squares = np.ones(count)
    for k in offsets:
        weight = np.ones(count)
        for m in offsets:
            if m != k:
                weight *= (here - nodes[m]) / (nodes[k] - nodes[m])
        residual -= weight * values[half_width + k : half_width + k + count]
        squares += weight**2
    return np.asarray(residual / np.sqrt(squares))


def smallest_step(values: Array) -> float:
    """The step of which all differences between levels are multiples; 0 if there is none."""
    levels = np.unique(values[np.isfinite(values)])
    if levels.size < 2:
        return 0.0
    # Equal values may differ in their last bits after a multiplication.
    rounding = 64 * np.finfo(np.float64).eps * max(abs(levels[0]), abs(levels[-1]))
    steps = np.diff(levels)
    steps = steps[steps > rounding]
    if steps.size == 0:
        return 0.0
    step = _common_divisor(np.unique(steps)[:FIRST_STEPS])
    near = steps[steps < LARGEST_MULTIPLE * step]
    if near.size < 3 or near.size < 0.5 * steps.size:
        return 0.0
    multiples = near / step
    off = np.abs(multiples - np.round(multiples))
    if np.mean(off < OFF_GRID + rounding / step) < WHOLE:
        return 0.0
    return float(np.median(near / np.round(multiples)))


def _common_divisor(steps: Array) -> float:
    """Euclid's greatest common divisor of rising numbers, ignoring remainders due to rounding."""
    divisor = float(steps[0])
    for step in steps[1:]:
        a, b = float(step), divisor
        while b > OFF_GRID * divisor:
            a, b = b, abs(a - b * round(a / b))
        divisor = a
    return divisor


def _sigma(time: Array, values: Array, *, half_width: int) -> float:
    residual = interpolation_residual(time, values, half_width=half_width)
    residual = residual[np.isfinite(residual)]
    return SIGMA_PER_MAD * float(np.median(np.abs(residual))) if residual.size >= 10 else math.nan


def _thinned(time: Array, values: Array) -> tuple[Array, Array]:
    """All samples of a short recording, else blocks of neighbours spread over it."""
    if values.size <= MOST_SAMPLES:
        return time, values
    starts = np.linspace(0, values.size - MOST_SAMPLES // BLOCKS, BLOCKS).astype(int)
    keep = (starts[:, None] + np.arange(MOST_SAMPLES // BLOCKS)[None, :]).ravel()
    return time[keep], values[keep]
