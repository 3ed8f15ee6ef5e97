"""Physically consistent inertial parameters, nearest to required values of linear combinations.

The parameters of a body are consistent where its pseudo-inertia

    J = [[S, h], [h^T, m]],   S = 1/2 tr(I) 1 - I about the frame's origin,   h = m c

is positive definite (Wensing, Kim and Slotine, IEEE Robotics and Automation Letters 3 (2018)); reflected
inertias are not negative. J is linear in the parameters, so finding the nearest ones is a convex problem,
solved by Newton steps with a barrier -log det J of decreasing weight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["BODY_NUMBERS", "Part", "nearest", "parts_of", "pseudo_inertia"]

Array = NDArray[np.float64]

#: Inertial parameters of a body in the order of `RobotModel.inertial_names`.
BODY_NUMBERS = (
    "mass",
    "first_moment.x",
    "first_moment.y",
    "first_moment.z",
    "inertia.xx",
    "inertia.yy",
    "inertia.zz",
    "inertia.xy",
    "inertia.xz",
    "inertia.yz",
)
#: Smallest eigenvalue of J at the start, for a body of typical size.
START = 1e-3
#: Most steps for each weight of the barrier; the decrease, as a part of that weight, or the step length below
#: which the iteration ends; and the part of the first-order decrease that a step has to achieve.
MOST, SMALL, FALL = 50, 1e-6, 0.1


@dataclass(frozen=True)
class Part:
    """Parameters with a matrix that has to be positive definite: J of a body, or a reflected inertia.

    Attributes:
        places: indices of its free parameters among all K free ones.
        by: derivatives of the matrix by each, in units of its rows and of the parameters, shape (k, d, d).
        fixed: contribution of the fixed parameters to the matrix, shape (d, d).
    """

    places: NDArray[np.int_]
    by: Array
    fixed: Array

    def matrix(self, numbers: Array) -> Array:
        """The matrix for values of all parameters, in their units."""
        return np.asarray(np.einsum("k,kij->ij", numbers[self.places], self.by) + self.fixed)

    def start(self, numbers: Array) -> Array:
        """Its parameters, moved a little inside the feasible set where they are at its edge."""
        values, vectors = np.linalg.eigh(self.matrix(numbers))
        inside = (vectors * np.maximum(values, START)) @ vectors.T - self.fixed
        flat = self.by.reshape(len(self.by), -1).T
        return np.asarray(np.linalg.lstsq(flat, inside.ravel(), rcond=None)[0])


def parts_of(
    names: Sequence[str], scale: Array, values: Array | None = None, free: NDArray[np.bool_] | None = None
) -> Iterator[Part]:
    """Every body with all parameters among `names` and some of them free, and every reflected inertia.

    Args:
        names: of P parameters.
        scale: typical sizes, shape (P,).
        values: with those of the fixed parameters, shape (P,); needed where there are any.
        free: which may change, shape (P,); all when left out.
    """
    place = {name: k for k, name in enumerate(names)}
    changes = np.ones(len(names), dtype=bool) if free is None else free
    among = np.cumsum(changes) - 1
    for name, k in place.items():
        body, _, number = name.partition(".")
        if number == "reflected_inertia" and changes[k]:
            yield Part(np.array([among[k]]), np.ones((1, 1, 1)), np.zeros((1, 1)))
        elif number == "mass" and all(f"{body}.{other}" in place for other in BODY_NUMBERS):
            own = np.array([place[f"{body}.{other}"] for other in BODY_NUMBERS])
            length = scale[own[1]] / scale[own[0]]
            units = np.sqrt(scale[own[0]]) * np.array([length, length, length, 1.0])
            by = np.stack([pseudo_inertia(unit) / np.outer(units, units) for unit in np.diag(scale[own])])
            held = ~changes[own]
            if held.all():
                continue
            fixed = np.zeros((4, 4))
            if held.any() and values is not None:
                fixed = np.einsum("k,kij->ij", (values[own] / scale[own])[held], by[held])
            yield Part(among[own[~held]], by[~held], fixed)


def nearest(
    parts: Sequence[Part], described: Array, seen: Array, asked: Array, *, close: float, last: float
) -> Array | None:
    """Consistent parameters x that minimise |seen x - asked|^2 + close^2 |x - described|^2.

    Args:
        parts: of the K parameters.
        described: their nominal values, in units of their typical sizes, shape (K,).
        seen: shape (M, K).
        asked: shape (M,).
        close: weight of a change by a parameter's typical size.
        last: final weight of the barrier.

    Returns:
        Shape (K,), in the same units; None where no consistent bodies are near the nominal ones.
    """
    numbers = described.copy()
    for part in parts:
        numbers[part.places] = part.start(described)
    bend = seen.T @ seen + close**2 * np.eye(numbers.size)

    def height(numbers: Array, barrier: float) -> float:
        off, away = seen @ numbers - asked, numbers - described
        if not np.isfinite(numbers).all() or any(
            np.linalg.eigvalsh(part.matrix(numbers))[0] <= 0.0 for part in parts
        ):
            return np.inf
        edge = sum(float(np.linalg.slogdet(part.matrix(numbers))[1]) for part in parts)
        return 0.5 * float(off @ off) + 0.5 * close**2 * float(away @ away) - barrier * edge

    first = height(numbers, 0.0)
    if not np.isfinite(first):
        return None
    for barrier in np.geomspace(max(first, last), last, 2 + int(np.log10(max(first / last, 1.0)))):
        for _ in range(MOST):
            slope = seen.T @ (seen @ numbers - asked) + close**2 * (numbers - described)
            step, falls = _step(parts, numbers, slope, bend, barrier)
            length, before = 1.0, height(numbers, barrier)
            while (
                length > SMALL
                and not height(numbers + length * step, barrier) < before - FALL * length * falls
            ):
                length /= 2.0
            if length <= SMALL:
                break
            numbers = numbers + length * step
            if falls < SMALL * barrier:
                break
    return numbers


def _step(
    parts: Sequence[Part], numbers: Array, slope: Array, bend: Array, barrier: float
) -> tuple[Array, float]:
    """The Newton step and its first-order decrease."""
    slope, bend = slope.copy(), bend.copy()
    for part in parts:
        scaled = np.linalg.inv(part.matrix(numbers)) @ part.by
        slope[part.places] -= barrier * np.einsum("kii->k", scaled)
        bend[np.ix_(part.places, part.places)] += barrier * np.einsum("kij,lji->kl", scaled, scaled)
    step = np.asarray(-np.linalg.solve(bend, slope), dtype=float)
    return step, -float(slope @ step)


def pseudo_inertia(numbers: Array) -> Array:
    """J of ten parameters, shape (4, 4)."""
    mass, *moment = numbers[:4]
    xx, yy, zz, xy, xz, yz = numbers[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    found = np.zeros((4, 4))
    found[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    found[:3, 3] = found[3, :3] = moment
    found[3, 3] = mass
    return found
