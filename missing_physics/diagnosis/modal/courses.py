"""Courses of linear systems whose numbers follow the pose, under forces that are known at every sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

__all__ = ["march", "transitions"]

Array = NDArray[np.float64]


def transitions(a: Array, b: Array, step: float) -> tuple[Array, Array, Array]:
    """Of y' = a y + b f over one step: by y, by f before and by f after it, f linear in between."""
    poses, size, forces = b.shape
    whole = np.zeros((poses, size + 2 * forces, size + 2 * forces))
    whole[:, :size, :size] = a * step
    whole[:, :size, size : size + forces] = b * step
    whole[:, size : size + forces, size + forces :] = np.eye(forces)
    moved = expm(whole)[:, :size]
    after = moved[:, :, size + forces :]
    return moved[:, :, :size], moved[:, :, size : size + forces] - after, after


def march(moves: tuple[Array, Array, Array], pose: NDArray[np.int_], forces: Array, first: Array) -> Array:
    """States (N, size, k) from the first one (size, k) under forces (N, s, k); pose of every sample.

    Stretches of about sqrt(N) samples advance side by side from zero; what their first states add follows.
    """
    transition, before, after = moves
    steps, (size, columns) = len(forces) - 1, first.shape
    length = max(1, int(np.sqrt(steps)))
    count = -(-steps // length)
    turns = np.broadcast_to(np.eye(size), (count * length, size, size)).copy()
    pushes = np.zeros((count * length, size, columns))
    turns[:steps] = transition[pose[:-1]]
    pushes[:steps] = before[pose[:-1]] @ forces[:-1] + after[pose[:-1]] @ forces[1:]
    turn, push = turns.reshape(count, length, size, size), pushes.reshape(count, length, size, columns)
    for k in range(1, length):
        push[:, k] += turn[:, k] @ push[:, k - 1]
        turn[:, k] = turn[:, k] @ turn[:, k - 1]
    starts = np.empty((count, size, columns))
    now = first
    for k in range(count):
        starts[k] = now
        now = turn[k, -1] @ now + push[k, -1]
    push += turn @ starts[:, None]
    return np.concatenate([first[None], pushes[:steps]])
