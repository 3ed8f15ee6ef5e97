"""Dependence of friction on velocity and displacement around reversals, law by law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.friction.cases import FREQUENCY, Case, run

__all__ = ["Features", "coefficient", "features", "reversal_windows"]

Array = NDArray[np.float64]

#: Friction is built up when it has reached this fraction of its level at break-away.
BUILT_UP = 0.9
#: Speeds at which the branches before and after a reversal are compared, relative to the highest.
COMPARED = np.linspace(0.01, 0.1, 41)
#: Limits of slow and of fast sliding, relative to the highest speed.
SLOW, QUICK = (0.05, 0.2), 0.95
#: Window around a reversal, as a fraction of the period on either side.
SIDE = 0.2


@dataclass(frozen=True)
class Features:
    """Numbers of one joint in reversing motion, means over its reversals; friction per load, so without unit.

    Attributes:
        travel: displacement from the reversal until friction is built up, pre-sliding [rad].
        loop: largest difference of the coefficient at the same slow speed before and after the reversal [-].
        stribeck: mean coefficient of slow over that of fast sliding [-].
        breakaway: largest coefficient [-].
    """

    travel: float
    loop: float
    stribeck: float
    breakaway: float


def coefficient(case: Case, joint: str) -> Array:
    """Friction torque over bearing load with preload, positive against positive velocity, shape (N,) [-]."""
    found = run(case)
    return np.asarray(-found[f"{joint}.friction_torque"] / (found[f"{joint}.load_moment"] + case.preload))


def reversal_windows(case: Case, joint: str) -> list[tuple[slice, int]]:
    """Samples around each reversal of the reference after the first period, and the joint's first reversal.

    It may stick and reverse several times; the second of a pair is the last sample before the first reversal.
    """
    found = run(case)
    time, velocity, rate = found.time, found[f"{joint}.velocity"], found[f"{joint}.reference_velocity"]
    side = SIDE / FREQUENCY
    windows = []
    for k in np.flatnonzero(np.sign(rate[1:]) * np.sign(rate[:-1]) < 0):
        if time[k] < 1 / FREQUENCY or time[k] + side > time[-1]:
            continue
        first, last = np.searchsorted(time, [time[k] - side, time[k] + side])
        turns = first + np.flatnonzero(velocity[first:last] * velocity[first + 1 : last + 1] <= 0)
        if turns.size:
            windows.append((slice(int(first), int(last)), int(turns[0])))
    return windows


def features(case: Case, joint: str) -> Features:
    """The numbers of one joint."""
    found = run(case)
    position, velocity = found[f"{joint}.position"], found[f"{joint}.velocity"]
    mu = coefficient(case, joint)
    late = found.time > 1 / FREQUENCY
    top, level = float(np.abs(velocity[late]).max()), float(np.abs(mu[late]).max())
    travels, loops = [], []
    for window, turn in reversal_windows(case, joint):
        sign = -np.sign(velocity[window.start])
        after = np.arange(turn, window.stop)
        built = after[sign * mu[after] >= BUILT_UP * level]
        if built.size:
            travels.append(abs(position[built[0]] - position[turn]))
        before = _branch(-sign * velocity[window.start : turn], -sign * mu[window.start : turn], top)
        sliding = after[1 + np.flatnonzero(velocity[after[:-1]] * velocity[after[1:]] <= 0)[-1] :]
        later = _branch(sign * velocity[sliding], sign * mu[sliding], top)
        loops.append(np.abs(later - before).max())
    speed = np.abs(velocity)
    slow = late & (speed > SLOW[0] * top) & (speed < SLOW[1] * top)
    quick = late & (speed > QUICK * top)
    return Features(
        travel=float(np.mean(travels)) if travels else float("nan"),
        loop=float(np.mean(loops)),
        stribeck=float(np.mean(np.abs(mu[slow])) / np.mean(np.abs(mu[quick]))),
        breakaway=level,
    )


def _branch(speed: Array, mu: Array, top: float) -> Array:
    """Coefficient at the compared speeds, of samples sorted by speed."""
    order = np.argsort(speed)
    return np.interp(COMPARED * top, speed[order], mu[order])
