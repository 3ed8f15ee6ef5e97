"""Delay of the recorded torque behind the recorded motion, from the residual of the standard model.

A torque that is recorded d late is tau(t - d), to first order tau - d tau'. So the residual of the standard
model is regressed on the time derivative of the torque, together with all parameters of the model, which
would otherwise absorb a part of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from missing_physics.standard.band import BandMotion, band_motion
from missing_physics.standard.bending import model_of
from missing_physics.standard.fit import design_of
from missing_physics.standard.model import StandardModel
from missing_physics.standard.rows import Rows, rows_of, without_friction
from robot_model import Recording

__all__ = ["Offset", "torque_offsets"]

Array = NDArray[np.float64]

#: Blocks of each recording whose scatter gives the standard deviations: longer than the residual's memory.
BLOCKS = 12
#: Ridge of the normal equations, whose columns have unit length: undetermined parameters keep their values.
RIDGE = 1e-8
#: Fewest rows from which a joint's delay is estimated.
FEWEST = 50


@dataclass(frozen=True)
class Offset:
    """Delay of one joint's torque behind the motion in one recording, and its standard deviation [s]."""

    joint: str
    delay: float
    deviation: float


@threadpool_limits.wrap(limits=1, user_api="blas")
def torque_offsets(
    standard: StandardModel, recordings: Sequence[Recording]
) -> tuple[tuple[Offset, ...], ...]:
    """Delays of the joints with enough rows, by recording; empty where a recording is too short."""
    model = model_of(without_friction(standard.nominal))
    about = standard.estimate.values
    rows = [rows_of(model, r, standard.cutoff, about=about, rest=standard.rest) for r in recordings]
    if min(own.time.size for own in rows) < FEWEST:
        return tuple(() for _ in rows)
    motions = [band_motion(model.robot, recording, standard.cutoff) for recording in recordings]
    columns, moved = _columns(standard, rows, motions)
    scale = np.sqrt(np.sum([(c**2).sum(axis=(0, 1)) for c in columns], axis=0))
    scale[scale == 0.0] = 1.0
    weight = 1.0 / np.maximum(standard.estimate.sigma, 1e-300)
    grams, rights = [], []
    for own, part in zip(rows, columns):
        left = standard.estimate.residual(own)
        for block in _blocks(own.time.size):
            counted = own.counted[block]
            x = (part[block] / scale)[counted] * np.broadcast_to(weight, counted.shape)[counted][:, None]
            y = (left[block] * weight)[counted]
            grams.append(x.T @ x)
            rights.append(x.T @ y)
    gram = np.sum(grams, axis=0)
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    inverse = np.linalg.pinv(gram / np.outer(size, size) + RIDGE * np.eye(size.size), hermitian=True)
    inverse /= np.outer(size, size)
    found = inverse @ np.sum(rights, axis=0)
    scores = np.array([right - part @ found for part, right in zip(grams, rights)])
    factor = len(scores) / max(len(scores) - 1, 1)
    covariance = factor * inverse @ (scores.T @ scores) @ inverse
    delay, deviation = -found / scale, np.sqrt(np.maximum(np.diag(covariance), 0.0)) / scale
    result = []
    for r, own in enumerate(rows):
        joints = [k for k in range(len(model.joints)) if own.counted[:, k].sum() >= FEWEST]
        places = [moved + r * len(model.joints) + k for k in joints]
        result.append(
            tuple(
                Offset(model.joints[k], float(delay[p]), float(deviation[p]))
                for k, p in zip(joints, places)
                if deviation[p] > 0.0
            )
        )
    return tuple(result)


def _columns(
    standard: StandardModel, rows: Sequence[Rows], motions: Sequence[BandMotion]
) -> tuple[list[Array], int]:
    """Per recording: derivatives by the model's free parameters, then tau' of every recording and joint."""
    free, found = np.flatnonzero(standard.estimate.layout.free), []
    joints = len(rows[0].noise)
    for r, (own, motion) in enumerate(zip(rows, motions)):
        slope = motion.reduce(np.nan_to_num(motion.torque_rate) * own.shares)
        shifts = np.zeros((own.time.size, joints, len(rows) * joints))
        for k in range(joints):
            shifts[:, k, r * joints + k] = slope[:, k]
        found.append(np.concatenate([design_of(own)[:, :, free], shifts], axis=2))
    return found, free.size


def _blocks(count: int) -> Iterator[slice]:
    cuts = np.linspace(0, count, BLOCKS + 1).astype(int)
    return (slice(a, b) for a, b in pairwise(cuts))
