"""Hysteresis states along a recording."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import wrightomega

from missing_physics.inference.kept import STEP

__all__ = ["dahl", "lagging"]

Array = NDArray[np.float64]


def dahl(drive: Array, travel: float, height: float = 0.0) -> Array:
    """State z of dz = (1 - z s) dx / (travel + height (1 - z s)), s = sign(dx), from z = 0.

    With height zero it is Dahl's law (Aerospace Corp. 1968). With a torque T for x, height T_h and K times
    the twist's travel for the travel, it is the state of ``T = K e + T_h z, travel dz = (1 - z s) de``: then
    dT = (K travel / (1 - z s) + T_h) dz. Exact for a drive that is monotonous between samples.
    """
    z = np.zeros(drive.size)
    steps = np.diff(drive)
    now = 0.0
    for i, change in enumerate(steps.tolist()):
        if change:
            now = _stepped(now, change, travel, height)
        z[i + 1] = now
    return z


def _stepped(z: float, change: float, travel: float, height: float) -> float:
    """With w = 1 - z s: -travel log(w+/w) + height (w - w+) = |change|, solved for w+ by Wright's omega."""
    side = 1.0 if change > 0 else -1.0
    before = 1.0 - z * side
    if before <= 0.0:
        return z
    ratio = height / travel
    if 1.0 + ratio == 1.0:  # the height is below rounding, and omega / ratio would underflow
        return side * (1.0 - before * math.exp(-abs(change) / travel))
    exponent = math.log(ratio) + math.log(before) + ratio * before - abs(change) / travel
    return side * (1.0 - float(wrightomega(exponent)) / ratio)


def lagging(torque: Array, size: float, height: float) -> Array:
    """The state of friction in a gear along the torque, and its derivatives by size and height, shape (N, 3).

    The gear is assumed to have reached its first torque monotonically from rest.
    """
    torque = np.concatenate([[0.0], torque])
    own, longer, higher = (
        dahl(torque, s, h)[1:]
        for s, h in ((size, height), (size * (1.0 + STEP), height), (size, height + STEP * size))
    )
    return np.column_stack([own, (longer - own) / (STEP * size), (higher - own) / (STEP * size)])
