"""Newmark's method for linear systems whose matrices change with the pose."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.compiled import c_library, switched_off

__all__ = ["newmark", "pushed", "transition", "vibrating"]

Array = NDArray[np.float64]

#: Newmark's beta of the trapezoidal rule, and that with a phase error of fourth order [-].
TRAPEZOIDAL, ACCURATE = 1 / 4, 1 / 12


def vibrating(
    inertia: Array,
    stiffness: Array,
    damping: Array,
    force: Array,
    step: float,
    start: tuple[Array, Array] | None = None,
    implicit: Array | float = TRAPEZOIDAL,
) -> tuple[Array, Array, Array]:
    """Deflections, rates and accelerations due to forces by Newmark's method, (N, ..., s, C) each.

    Args:
        inertia: shape (N, ..., s, s), for several systems at once.
        stiffness, damping: shape (..., s, s) or (N, ..., s, s).
        force: shape (N, ..., s, C).
        step: time between instants [s].
        start: deflection and rate at the first instant, shape (..., s, C) each; zero when None.
        implicit: Newmark's beta, a number or matrices (..., s, s) (`newmark`).
    """
    modes = inertia.shape[-1]
    weight = step**2 * (np.asarray(implicit) if np.ndim(implicit) else implicit * np.eye(modes))
    damping, stiffness = (np.broadcast_to(part, inertia.shape) for part in (damping, stiffness))
    solver = np.linalg.inv(inertia + step / 2 * damping + stiffness @ weight)
    answer, pushed = solver @ np.concatenate([stiffness, damping], axis=-1), solver @ force
    place, rate = np.zeros((2, *force.shape[1:])) if start is None else start
    first = np.linalg.solve(inertia[0], force[0] - stiffness[0] @ place - damping[0] @ rate)
    state = np.concatenate([place - weight @ first, rate - step / 2 * first], axis=-2)
    states = _predicted(answer, pushed, state, step)
    found = np.asarray(pushed - answer @ states)
    return states[..., :modes, :] + weight @ found, states[..., modes:, :] + step / 2 * found, found


def _predicted(answer: Array, pushed: Array, start: Array, step: float) -> Array:
    """The predicted part w of Newmark's method, deflections then rates, (N, ..., 2 s, C), with a = b - A w.

    Blocks of about sqrt(N) instants march side by side, first from zero and from unit states, then from the
    states that follow for their beginnings.

    Args:
        answer: A, shape (N, ..., s, 2 s).
        pushed: b, shape (N, ..., s, C).
        start: w at the first instant, shape (..., 2 s, C).
        step: time between instants [s].
    """
    size = int(np.ceil(np.sqrt(len(pushed))))
    count = -(-len(pushed) // size)

    def blocks(values: Array) -> Array:
        padded = np.zeros((count * size, *values.shape[1:]))
        padded[: len(values)] = values
        return padded.reshape(count, size, *values.shape[1:])

    def march(state: Array, pushes: Array, kept: Array | None = None) -> Array:
        modes = state.shape[-2] // 2
        places, rates = state[..., :modes, :], state[..., modes:, :]
        for k in range(size):
            if kept is not None:
                kept[:, k] = state
            moved = -answers[:, k] @ state
            moved[..., : pushes.shape[-1]] += pushes[:, k]
            places += step * (rates + step * moved)
            rates += step * moved
        return state

    answers, pushes, columns = blocks(answer), blocks(pushed), start.shape[-1]
    unit = np.broadcast_to(np.eye(start.shape[-2]), (count, *start.shape[:-1], start.shape[-2]))
    ends = march(np.concatenate([np.zeros((count, *start.shape)), unit], axis=-1), pushes)
    begins = [start]
    for end in ends[:-1]:
        begins.append(end[..., :columns] + end[..., columns:] @ begins[-1])
    kept = np.empty((count, size, *start.shape))
    march(np.stack(begins), pushes, kept)
    return kept.reshape(count * size, *start.shape)[: len(pushed)]


def pushed(
    mass: Sequence[Array],
    rate: Sequence[Array],
    place: Sequence[Array],
    force: Sequence[Array],
    springs: Sequence[tuple[Array, Array]],
    start: Array,
    step: float,
    implicit: Array,
) -> Array:
    """Forces M a + D v + G u of V systems of p coordinates on n other rows, shape (N, n, V, C).

    Compiled where there is a C compiler.

    Args:
        mass, rate, place: M, D and G of each system, in the rows of its coordinates, then in the others,
            shape (N, p + n, p) each.
        force: on the coordinates, in the first of C columns, shape (N, p) each.
        springs: further stiffness and damping of the coordinates, shape (p, p) each.
        start: deflections and rates at the first instant, shape (2, V, p, C).
        step: time between instants [s].
        implicit: Newmark's beta, shape (V, p, p) (`newmark`).
    """
    count, systems = force[0].shape[1], len(force)
    others = mass[0].shape[1] - count
    kernel = None if switched_off() else _kernel(count)
    if kernel is not None:
        found = np.empty((len(force[0]), others, systems, start.shape[3]))
        series = [[np.ascontiguousarray(own, float) for own in part] for part in (mass, rate, place, force)]
        matrices = [np.ascontiguousarray(own, float) for own in (springs, implicit, start)]
        sizes = map(ctypes.c_long, (len(found), systems, others, start.shape[3]))
        pointers = [(ctypes.c_void_p * systems)(*(own.ctypes.data for own in part)) for part in series]
        addresses = [ctypes.c_void_p(own.ctypes.data) for own in (*matrices, found)]
        kernel(*sizes, ctypes.c_double(step), *pointers, *addresses)
        return found
    damping, stiffness = (
        np.stack([own[:, :count] + spring[which] for own, spring in zip(part, springs)], axis=1)
        for part, which in ((rate, 1), (place, 0))
    )
    inertia = np.stack([own[:, :count] for own in mass], axis=1)
    forces = np.zeros((*inertia.shape[:3], start.shape[3]))
    forces[..., 0] = np.stack(force, axis=1)
    moved = vibrating(inertia, stiffness, damping, forces, step, (start[0], start[1]), implicit)
    parts = [
        zip((own[:, count:] for own in each), np.moveaxis(m, 1, 0))
        for each, m in zip((place, rate, mass), moved)
    ]
    return np.stack([sum(a @ b for a, b in each) for each in zip(*parts)], axis=2)


@cache
def _kernel(count: int) -> Any:
    """The compiled function for systems of so many coordinates; None where it cannot be compiled."""
    source = (Path(__file__).parent / "newmark.c").read_text(encoding="utf-8")
    try:
        return ctypes.CDLL(str(c_library(f"enum {{ P = {count} }};\n{source}", "-O3"))).pushed
    except (OSError, subprocess.SubprocessError):
        return None


def newmark(inertia: Array, stiffness: Array, step: float) -> Array:
    """Newmark's beta for each mode of a system, as a matrix, shape (..., s, s).

    1/12 has an error of the phase of fourth order, but is unstable above sqrt(6) radians per step; modes
    above half of that get 1/4, which is always stable.

    Args:
        inertia, stiffness: symmetric, shape (..., s, s) each; the stiffness may be singular.
        step: time between instants [s].
    """
    root = np.linalg.cholesky(inertia)
    across = np.linalg.solve(root, np.linalg.solve(root, stiffness).swapaxes(-1, -2))
    squared, modes = np.linalg.eigh(across)
    slow = squared * step**2 < 6.0 / 4.0
    beta = np.where(slow, ACCURATE, TRAPEZOIDAL)
    shapes = np.linalg.solve(root.swapaxes(-1, -2), modes)  # of mass one
    return np.asarray(shapes * beta[..., None, :] @ (shapes.swapaxes(-1, -2) @ inertia))


def transition(inertia: Array, stiffness: Array, damping: Array, step: float) -> tuple[Array, Array]:
    """The trapezoidal rule with steps h, of modes with mass matrix M, stiffness K and damping C.

    With the predicted deflections and rates w at an instant, a = -S [K, C] w with
    S = (M + h/2 C + h^2/4 K)^-1, and w at the next one is T w.

    Returns:
        T and S [K, C].
    """
    damping, stiffness = (np.broadcast_to(part, inertia.shape) for part in (damping, stiffness))
    solver = np.linalg.inv(inertia + step / 2 * damping + TRAPEZOIDAL * step**2 * stiffness)
    answer, unit = solver @ np.concatenate([stiffness, damping], axis=-1), np.eye(inertia.shape[-1])
    onwards = np.block([[unit, step * unit], [np.zeros_like(unit), unit]])
    kick = np.vstack([step**2 * unit, step * unit])
    return np.asarray(onwards - kick @ answer), np.asarray(answer)
