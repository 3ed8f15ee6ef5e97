"""The Kalman filter of `modal/smoother.py` and the smoother that runs back over what it kept.

With S = L L^T the covariance of the innovations e, H what is seen of the state and P its predicted
covariance, the filter works with the white innovations w = L^-1 e and with W = L^-1 H P,

    mean + W^T w,    P - W^T W,

so that one triangular factor serves gain, covariance and likelihood. Offsets and gains of channels stay
what they are but for a random walk: only the first rows of the state move. The fixed-interval smoother of
Bryson and Frazier needs nothing but W, L^-1 and w of every sample (Bierman, Automatica 9 (1973) 503-511).
Gains do not depend on the data: other data of the same noise take them as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy.linalg.lapack import dpotrf, dtrtri

from missing_physics.diagnosis.modal.state import StateSpace

__all__ = ["Data", "Filtered", "filtered", "filtered_again", "smoothed", "spreads"]

Array = NDArray[np.float64]

#: Samples of which matrices are made at once.
CHUNK = 512


@dataclass(frozen=True)
class Data:
    """What drives the state and what is seen of it, D sets at once.

    Attributes:
        pushed: added to the moving rows of the state on the way to the next sample, shape (K, d, D).
        gap: of the channels, what they see of r taken off, shape (K, m, D).
    """

    pushed: Array
    gap: Array


@dataclass(frozen=True)
class Filtered:
    """What is kept of K samples.

    Attributes:
        likelihood: logarithm, of the first set of data.
        white: innovations of unit covariance, shape (K, m, D).
        last: predicted mean of the last sample, shape (L, D).
        gains: W, shape (K, m, L); empty in a search.
        roots: L^-1, shape (K, m, m).
        told: what is asked of the predicted mean, shape (K, r, D).
        spread: the same of the rows of P, shape (K, r, L).
    """

    likelihood: float
    white: Array
    last: Array
    gains: NDArray[np.floating]
    roots: NDArray[np.floating]
    told: Array
    spread: NDArray[np.floating]


def filtered(
    space: StateSpace,
    data: Data,
    *,
    start: Array,
    added: Array,
    drift: Array,
    noise: Array,
    asked: Array | None = None,
    kept: DTypeLike = np.float32,
) -> Filtered:
    """Run over all samples of `space`.

    Args:
        space: the system.
        data: along it.
        start: variances of the first state, shape (L,).
        added: covariance that one step adds to the moving rows at every pose, shape (P, d, d).
        drift: variance that it adds to the others, shape (L - d,).
        noise: variances of the channels, shape (m,).
        asked: what of the moving rows is told at every pose, shape (P, r, d); nothing is kept without.
        kept: precision of what is kept. Gains that are wrong by 1e-7 of themselves make a smoother that is
            short of the best by the square of that.
    """
    count, size, d = len(space.pose), len(start), space.moves.shape[1]
    channels, sets = data.gap.shape[1:]
    some = count if asked is not None else 0
    rows = asked.shape[1] if asked is not None else 0
    gains = np.empty((some, channels, size), dtype=kept)
    roots = np.empty((some, channels, channels), dtype=kept)
    spread, told = np.empty((some, rows, size), dtype=kept), np.empty((some, rows, sets))
    white, scales = np.empty((count, channels, sets)), np.empty((count, channels))
    covariance, measured = np.diag(start), np.diag(noise)
    walking = np.flatnonzero(drift)
    places, walk = d + walking, drift[walking]
    mean = last = np.zeros((size, sets))
    for first in range(0, count, CHUNK):
        looks = space.looks(slice(first, first + CHUNK))
        for k, look in enumerate(looks, start=first):
            pose, last = space.pose[k], mean
            move = space.moves[pose]
            shown = look.dot(covariance)
            root, failed = dpotrf((shown.dot(look.T) + measured).T, lower=1, overwrite_a=1)
            if failed:
                raise np.linalg.LinAlgError("the covariance of the innovations is not positive.")
            scales[k] = root.diagonal()
            root = dtrtri(root, lower=1)[0]
            gain = root.dot(shown)
            white[k] = e = root.dot(data.gap[k] - look.dot(mean))
            if asked is not None:
                gains[k], roots[k] = gain, root
                told[k] = asked[pose].dot(mean[:d])
                spread[k] = asked[pose].dot(covariance[:d])
            mean = mean + gain.T.dot(e)
            mean[:d] = move.dot(mean[:d]) + data.pushed[k]
            covariance -= gain.T.dot(gain)
            moved = move.dot(covariance[:d])
            own = moved[:, :d].dot(move.T) + added[pose]
            covariance[:d, d:] = moved[:, d:]
            covariance[d:, :d] = moved[:, d:].T
            covariance[:d, :d] = 0.5 * (own + own.T)
            covariance[places, places] += walk
    likelihood = -0.5 * float(np.sum(white[:, :, 0] ** 2)) - float(np.sum(np.log(scales)))
    return Filtered(likelihood, white, last, gains, roots, told, spread)


def filtered_again(space: StateSpace, data: Data, known: Filtered, asked: Array) -> Filtered:
    """The same for other data, with the gains that are known."""
    count, size, d = len(space.pose), known.gains.shape[2], space.moves.shape[1]
    channels, sets = data.gap.shape[1:]
    white, told = np.empty((count, channels, sets)), np.empty((count, asked.shape[1], sets))
    mean = last = np.zeros((size, sets))
    for first in range(0, count, CHUNK):
        chunk = slice(first, first + CHUNK)
        both = (part[chunk].astype(float) for part in (known.gains, known.roots))
        for k, (look, gain, root) in enumerate(zip(space.looks(chunk), *both), start=first):
            pose, last = space.pose[k], mean
            white[k] = e = root.dot(data.gap[k] - look.dot(mean))
            told[k] = asked[pose].dot(mean[:d])
            mean = mean + gain.T.dot(e)
            mean[:d] = space.moves[pose].dot(mean[:d]) + data.pushed[k]
    return Filtered(float("nan"), white, last, known.gains, known.roots, told, known.spread)


def smoothed(space: StateSpace, filtered: Filtered) -> Array:
    """What was asked for, by all samples, shape (K, r, D)."""
    d, told = space.moves.shape[1], filtered.told.copy()
    adjoint = np.zeros(filtered.last.shape)  # of the state after the measurement
    for chunk in _backwards(len(space.pose)):
        gains, seen, spread = _of_chunk(space, filtered, chunk)
        white, poses = filtered.white[chunk], space.pose[chunk]
        for k in range(len(gains) - 1, -1, -1):
            if chunk.start + k + 1 < len(space.pose):
                move = space.moves[poses[k]]
                adjoint[:d] = move.T.dot(adjoint[:d])
            adjoint -= seen[k].T.dot(white[k] + gains[k].dot(adjoint))
            told[chunk.start + k] -= spread[k].dot(adjoint)
    return told


def spreads(space: StateSpace, filtered: Filtered, wanted: NDArray[np.int_], asked: Array) -> Array:
    """Covariance of the errors of what was asked for at some samples, shape (len(wanted), r, r)."""
    d, size = space.moves.shape[1], filtered.gains.shape[2]
    places = {int(k): place for place, k in enumerate(wanted)}
    found = np.zeros((len(wanted), filtered.told.shape[1], filtered.told.shape[1]))
    weight = np.zeros((size, size))  # covariance of the adjoint
    for chunk in _backwards(len(space.pose)):
        gains, seen, spread = _of_chunk(space, filtered, chunk)
        for k in range(len(gains) - 1, -1, -1):
            place = chunk.start + k
            pose = space.pose[place]
            if place + 1 < len(space.pose):
                move = space.moves[pose]
                weight[:d] = move.T.dot(weight[:d])
                weight[:, :d] = weight[:, :d].dot(move)
            weight -= seen[k].T.dot(gains[k].dot(weight))
            weight -= weight.dot(gains[k].T).dot(seen[k])
            weight += seen[k].T.dot(seen[k])
            if place in places:
                predicted = spread[k][:, :d].dot(asked[pose].T)
                found[places[place]] = predicted - spread[k].dot(weight).dot(spread[k].T)
    return found


def _backwards(count: int) -> list[slice]:
    return [slice(first, min(first + CHUNK, count)) for first in range(0, count, CHUNK)][::-1]


def _of_chunk(space: StateSpace, filtered: Filtered, chunk: slice) -> tuple[Array, Array, Array]:
    """W, L^-1 H and the rows of P, in double precision."""
    seen = filtered.roots[chunk].astype(float) @ space.looks(chunk)
    return filtered.gains[chunk].astype(float), seen, filtered.spread[chunk].astype(float)
