"""What a change of base or flexible links must hold against, by innovations linearised at its fit.

A joint at rest or at a reversal sticks: bristles and smoothed laws of friction yield there by less than an
encoder tells, and restrain and damp the modes in a way that a slowly walking torque does not follow. Where a
joint slides one way, friction takes next to no part in vibration. So a change of base and links is asked of
the samples in which every joint slides, alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.naming.search import ODDS
from missing_physics.diagnosis.passive.fit import PassiveFit, at_joints, masses

__all__ = ["beside_others", "borne_out", "moving", "needed_of"]

Array = NDArray[np.float64]

#: Evidence asked for, as a part of half the energy that white innovations have: errors of the smoother's own
#: dynamics and noise gained up to 0.005 in simulated flexible robots in which nothing is missing.
OWN_ERRORS = 0.01
#: A joint slides where its speed is beyond this multiple of the one below which its sign is not known.
SLIDING = 10.0
#: What the numbers of the whole fit do there is at least this part of what the best numbers would do.
ALIKE = 0.7


def needed_of(innovations: int, tried: int) -> float:
    """Evidence that is asked of so many innovations with so many candidates."""
    return max(float(np.log(ODDS * tried)), 0.5 * OWN_ERRORS * innovations)


def moving(segments: Sequence[Segment]) -> NDArray[np.bool_]:
    """Samples of all recordings in which every joint slides, shape (N,)."""
    parts = []
    for segment in segments:
        slow = np.array([place.transition for place in segment.places])
        parts.append(np.all(np.abs(segment.motion.velocity) > SLIDING * slow, axis=1))
    return np.concatenate(parts)


def beside_others(trial: PassiveFit, place: slice, directions: Array) -> float:
    """Evidence for the last term where masses, inertias and joints are free.

    Args:
        trial: fitted recordings.
        place: of the term's numbers among all.
        directions: combinations of inertial numbers that are free, shape (P, B).
    """
    others, target, own = _linearised(trial, place, directions)
    gain = 0.5 * (_left(others, target) - _left(np.hstack([others, own]), target))
    return gain - _price(place, target)


def borne_out(trial: PassiveFit, place: slice, directions: Array, tried: int) -> str:
    """Why the stretches in which all joints slide do not bear the last term out; empty where they do.

    Args:
        trial, place, directions: as of `beside_others`.
        tried: number of candidates.
    """
    lengths = [segment.motion.time.size for segment in trial.segments]
    each = np.repeat(moving(trial.segments), np.repeat([s.channels for s in trial.smoothers], lengths))
    if not each.any():
        return "some joint is at rest at any time: friction that sticks cannot be told from it"
    others, target, own = (part[each] for part in _linearised(trial, place, directions))
    values = np.concatenate([t.values for t in trial.terms])[place]
    without = _left(others, target)
    held = 0.5 * (without - _left(others, target - own @ values))
    best = 0.5 * (without - _left(np.hstack([others, own]), target))
    evidence = held - _price(place, target)
    if evidence < needed_of(target.size, tried):
        return f"not borne out where every joint moves (evidence {evidence:.1f} there)"
    if held < ALIKE * best:
        return f"other numbers where every joint moves ({held:.1f} of a gain of {best:.1f} there)"
    return ""


def _linearised(trial: PassiveFit, place: slice, directions: Array) -> tuple[Array, Array, Array]:
    """Columns of all else, what is to be explained, and columns of the term: rows of the innovations."""
    parts = []
    for segment, smoother in zip(trial.segments, trial.smoothers):
        free_too = (masses(segment, directions), at_joints(segment))
        white = np.concatenate([smoother.whitened(*columns) for columns in free_too], axis=2)
        parts.append(white.reshape(-1, white.shape[2]))
    columns = trial.columns
    own = columns[:, place]
    rest = np.delete(columns, np.arange(place.start, place.stop), axis=1)
    values = np.concatenate([t.values for t in trial.terms])[place]
    return np.hstack([np.concatenate(parts), rest]), trial.errors + own @ values, own


def _price(place: slice, target: Array) -> float:
    """Of the numbers, by the Bayesian information criterion."""
    return 0.5 * (place.stop - place.start) * float(np.log(target.size))


def _left(columns: Array, target: Array) -> float:
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0] / size[size > 0]
    left = target - columns @ np.linalg.lstsq(columns, target, rcond=1e-9)[0]
    return float(left @ left)
