"""Samples in which joints slide, so that the direction of their friction is known.

Near a stop or a reversal the direction of dry friction does not follow from a smoothed velocity. Within its
noise the sign is not known; and when friction jumps, so does the acceleration, which a filter smooths. A
velocity whose slope changes by da within the memory m of the filter is wrong by up to about m da / 2 there.
The friction of a slower joint may have any value up to its level c, as at rest: an error of standard
deviation c in addition to the noise n of the compared signal. Such samples are therefore multiplied by n^2 /
(n^2 + c^2), the fraction of their variance that is noise. This is done in the time domain, before the band's
filter would spread the error. The remaining error is below n / 2 and vanishes for large friction. A vibrating
link without dry friction is compared throughout.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label, maximum_filter1d, minimum_filter1d

__all__ = ["NEAR", "cells", "determined", "directions", "shares", "slides", "undetermined"]

Array = NDArray[np.float64]

#: Standard deviations of the velocity within which its sign is not known.
NEAR = 3.0
#: Largest error at a kink, as a fraction of filter memory times change of slope: that of a moving average.
ROUNDED = 0.5
#: Error of the velocity at the kink itself, as the same fraction, of the zero-phase filter of
#: `evaluation.band`: the mean of the positive part of time, weighted by its impulse response.
KINK = 0.104


def slides(
    velocity: Array, acceleration: Array, noise: Array, *, memory: float, step: float
) -> NDArray[np.bool_]:
    """Samples in which each joint slides, shape (N, n).

    Args:
        velocity, acceleration: smoothed, shape (N, n) [rad/s and rad/s^2, or m].
        noise: standard deviation of the smoothed velocity, shape (n,).
        memory: of the filter [s].
        step: sampling time [s].
    """
    size = 2 * int(np.ceil(memory / step)) + 1
    change = maximum_filter1d(acceleration, size, axis=0) - minimum_filter1d(acceleration, size, axis=0)
    change = maximum_filter1d(change, size, axis=0)
    bend = ROUNDED * memory * _certain(change, noise, memory)
    near = np.abs(velocity) <= NEAR * noise + bend
    spread = int(np.ceil(memory / step)) | 1  # the filter spreads friction this far
    return np.asarray(~maximum_filter1d(near, spread, axis=0))


def undetermined(
    velocity: Array, acceleration: Array, noise: Array, *, memory: float, step: float
) -> NDArray[np.bool_]:
    """Samples in which the direction of each joint's motion is not known, shape (N, n).

    Args:
        velocity, acceleration, noise, memory, step: see `slides`.
    """
    size = 2 * int(np.ceil(memory / step)) + 1
    change = maximum_filter1d(acceleration, size, axis=0) - minimum_filter1d(acceleration, size, axis=0)
    found = np.abs(velocity) <= NEAR * noise + KINK * memory * _certain(change, noise, memory)
    crossed = velocity[1:] * velocity[:-1] <= 0.0
    found[1:] |= crossed
    found[:-1] |= crossed
    return np.asarray(found)


def _certain(change: Array, noise: Array, memory: float) -> Array:
    """Change of acceleration beyond its noise, which is white below 1 / (2 memory), shape (N, n)."""
    random = NEAR * np.pi / memory * np.sqrt(3.0 / 5.0) * noise
    return np.sqrt(np.maximum(change**2 - random**2, 0.0))


def cells(
    unknown: NDArray[np.bool_],
    slow: NDArray[np.bool_],
    near: NDArray[np.bool_],
    *,
    longest: int,
    size: int,
) -> tuple[NDArray[np.bool_], list[slice]]:
    """Samples near the stops of one joint, and its quick reversals divided into cells.

    Args:
        unknown: samples in which its direction is not known, shape (N,).
        slow: these, and those in which it hardly moves, shape (N,).
        near: these, and those to which the filter spreads their friction, shape (N,), see `slides`.
        longest: number of slow samples in a row above which it stops.
        size: largest number of samples in a cell.

    Returns:
        Mask of the samples near stops, shape (N,), and the cells.
    """
    parts, _ = label(near)
    stops = [parts[first] for first, last in _stretches(slow) if last - first > longest]
    rest, found = np.isin(parts, stops), []
    for first, last in _stretches(unknown):
        if not rest[first]:
            cuts = np.linspace(first, last, -(-(last - first) // size) + 1).round().astype(int)
            found += [slice(*own) for own in pairwise(cuts)]
    return rest, found


def _stretches(mask: NDArray[np.bool_]) -> NDArray[np.int_]:
    """First sample of each stretch of a mask, and the one after its last, shape (S, 2)."""
    return np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int))).reshape(-1, 2)


def determined(noise: Array, dry: Array) -> Array:
    """Weight of samples in which a joint may be at rest, 0 to 1, shape (n,).

    Args:
        noise: rms of the compared signal without dry friction, shape (n,) [N m or N].
        dry: level of each joint's dry friction, shape (n,).
    """
    size = np.hypot(noise, dry)
    return np.asarray(np.where(size > 0.0, noise / np.where(size > 0.0, size, 1.0), 1.0) ** 2)


def shares(known: NDArray[np.bool_], rest: Array) -> Array:
    """Weight of every sample: one where a joint slides, `rest` elsewhere, shape (N, n).

    Args:
        known: samples in which each joint slides, shape (N, n).
        rest: see `determined`, shape (n,).
    """
    return np.where(known, 1.0, rest)


def directions(velocity: Array, known: NDArray[np.bool_]) -> Array:
    """Direction of each joint's friction, -1 to 1, shape (N, n): interpolated where it is not known.

    Args:
        velocity: smoothed, shape (N, n).
        known: samples in which each joint slides, shape (N, n); a joint that never certainly slides gets the
            sign of its velocity.
    """
    found, samples = np.sign(velocity), np.arange(len(velocity))
    for k, own in enumerate(known.T):
        if own.any():
            found[:, k] = np.interp(samples, samples[own], np.sign(velocity[own, k]))
    return found
