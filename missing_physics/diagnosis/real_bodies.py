"""Inertial numbers of real bodies that do what the data ask of combinations of them.

Data fix combinations of masses, first moments and inertias only (base parameters), and leave the others where
they were; body by body the result may have a negative inertia. A body is real where its pseudo-inertia

    J = [[S, h], [h^T, m]],   S = 1/2 tr(I) 1 - I about the frame's origin,   h = m c

is positive definite (Wensing, Kim and Slotine, IEEE Robotics and Automation Letters 3 (2018)); reflected
inertias are not negative. J is linear in the numbers, so that those nearest to what is asked for, in units of
its uncertainty, are a convex problem, solved by Newton steps with a barrier -log det J that is lowered.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from missing_physics.diagnosis.terms import BODY_NUMBERS, Term
from reference_model.inertial import ten_numbers
from robot_model import Robot

__all__ = ["UNREAL", "nearest_real", "unreal"]

Array = NDArray[np.float64]

#: Why names go with which a body would not be real.
UNREAL = "beside what else is named a body would need mass properties that no body like the described one has"
#: Where what is asked has to be left by more than its uncertainty explains with this chance, no body is real.
CHANCE = 1e-3
#: Weight of a number's whole typical size beside one standard deviation of what is asked.
CLOSE = 0.1
#: Least eigenvalue of J, of a body of usual size, from which steps start.
START = 1e-3
#: The last weight of the barrier; the first is what is left at the start, or steps would follow the edge.
#: Steps with each weight; the last one falls by less than this part of that weight, or is shorter than that;
#: and part of the fall to first order that a step has to keep.
LAST, MOST, SMALL, FALL = 1e-4, 50, 1e-6, 0.1
#: By how much numbers of a body that is weighed may be off: relative to themselves, and to their usual size.
OFF, ALWAYS_OFF = 0.1, 0.02
#: How many times as heavy as described a body may be; least mass [kg] and distance [m] that count.
HEAVIEST, LEAST = 5.0, 1e-3


def unreal(robot: Robot, term: Term) -> bool:
    """Whether no body that resembles the described one has the mass properties that a term gives it.

    Numbers that the data do not tell are free: a first moment may be one of little mass far out or of much
    close by, and what is asked for may be off by a tenth.
    """
    named = term.effect.id == "inertia" and any(link.name == term.at for link in robot.links)
    if not named or robot.link(term.at).flexible:
        return False
    link, numbers = robot.link(term.at), [number.replace(".", "_") for number in BODY_NUMBERS]
    mass, length = max(link.mass, LEAST), max(float(np.linalg.norm(link.center_of_mass)), LEAST)
    spread = max(mass * length**2, *(abs(part) for part in link.inertia))
    scale = np.array([mass, *[mass * length] * 3, *[spread] * 6])
    told = [number for number in numbers if number in term.free]
    places = np.array([numbers.index(number) for number in told], dtype=int)
    directions = np.zeros((len(numbers), len(told)))
    directions[places, np.arange(len(told))] = scale[places]
    wanted = np.array([term.parameters[number] for number in told]) / scale[places]
    doubt = np.diag((OFF * np.abs(wanted) + ALWAYS_OFF) ** 2)
    names = [f"{link.name}.{number}" for number in BODY_NUMBERS]
    change = nearest_real(names, ten_numbers(link), directions, scale, wanted, doubt)
    return change is None or bool(link.mass + change[0] > HEAVIEST * mass)


@dataclass(frozen=True)
class _Part:
    """Numbers of which a matrix has to be positive definite: J of a body, or a reflected inertia.

    Attributes:
        places: of the K numbers.
        by: derivatives of the matrix by each, in units of its rows and of the numbers, shape (K, d, d).
    """

    places: NDArray[np.int_]
    by: Array

    def matrix(self, numbers: Array) -> Array:
        """At all numbers, in their units."""
        return np.asarray(np.einsum("k,kij->ij", numbers[self.places], self.by))

    def start(self, numbers: Array) -> Array:
        """Its numbers, a little inside where they are at the edge."""
        values, vectors = np.linalg.eigh(self.matrix(numbers))
        inside = (vectors * np.maximum(values, START)) @ vectors.T
        flat = self.by.reshape(len(self.by), -1).T
        return np.asarray(np.linalg.lstsq(flat, inside.ravel(), rcond=None)[0])


def nearest_real(
    names: Sequence[str], nominal: Array, directions: Array, scale: Array, wanted: Array, covariance: Array
) -> Array | None:
    """Change of inertial numbers after which all bodies are real and combinations are what is wanted.

    Args:
        names: of the P numbers.
        nominal: their values, shape (P,).
        directions: change of the numbers per unit of each of B combinations, orthonormal in units of `scale`,
            shape (P, B).
        scale: typical sizes of the numbers, shape (P,).
        wanted: values of the combinations, shape (B,).
        covariance: of these, shape (B, B).

    Returns:
        Shape (P,); None where real bodies are off by more than the uncertainty, and where some numbers of a
        body are known and others are not.
    """
    parts = list(_parts(names, scale))
    if (
        len(wanted) == 0
        or not np.isfinite(wanted).all()
        or sum(part.places.size for part in parts) < len(names)
    ):
        return None
    values, vectors = np.linalg.eigh(covariance)
    whiten = (vectors / np.sqrt(np.maximum(values, 1e-12 * values[-1]))).T
    seen, described = whiten @ (directions / scale[:, None]).T, nominal / scale
    asked = whiten @ wanted + seen @ described
    numbers = described.copy()
    for part in parts:
        numbers[part.places] = part.start(described)
    bend = seen.T @ seen + CLOSE**2 * np.eye(numbers.size)

    def height(numbers: Array, barrier: float) -> float:
        off, away = seen @ numbers - asked, numbers - described
        if not np.isfinite(numbers).all() or any(
            np.linalg.eigvalsh(part.matrix(numbers))[0] <= 0.0 for part in parts
        ):
            return np.inf
        edge = sum(float(np.linalg.slogdet(part.matrix(numbers))[1]) for part in parts)
        return 0.5 * float(off @ off) + 0.5 * CLOSE**2 * float(away @ away) - barrier * edge

    first = height(numbers, 0.0)
    for barrier in np.geomspace(max(first, LAST), LAST, 2 + int(np.log10(max(first / LAST, 1.0)))):
        for _ in range(MOST):
            slope = seen.T @ (seen @ numbers - asked) + CLOSE**2 * (numbers - described)
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
    off = seen @ numbers - asked
    if float(off @ off) > chi2.isf(CHANCE, len(wanted)):
        return None
    return np.asarray((numbers - described) * scale)


def _step(
    parts: Sequence[_Part], numbers: Array, slope: Array, bend: Array, barrier: float
) -> tuple[Array, float]:
    """Newton's, and by how much it falls to first order."""
    slope, bend = slope.copy(), bend.copy()
    for part in parts:
        scaled = np.linalg.inv(part.matrix(numbers)) @ part.by
        slope[part.places] -= barrier * np.einsum("kii->k", scaled)
        bend[np.ix_(part.places, part.places)] += barrier * np.einsum("kij,lji->kl", scaled, scaled)
    step = np.asarray(-np.linalg.solve(bend, slope), dtype=float)
    return step, -float(slope @ step)


def _parts(names: Sequence[str], scale: Array) -> Iterator[_Part]:
    """Every body of which all numbers are free, and every reflected inertia."""
    place = {name: k for k, name in enumerate(names)}
    for name, k in place.items():
        body, _, number = name.partition(".")
        if number == "reflected_inertia":
            yield _Part(np.array([k]), np.ones((1, 1, 1)))
        elif number == "mass" and all(f"{body}.{other}" in place for other in BODY_NUMBERS):
            own = np.array([place[f"{body}.{other}"] for other in BODY_NUMBERS])
            length = scale[own[1]] / scale[own[0]]
            units = np.sqrt(scale[own[0]]) * np.array([length, length, length, 1.0])
            by = [_pseudo(unit) / np.outer(units, units) for unit in np.diag(scale[own])]
            yield _Part(own, np.stack(by))


def _pseudo(numbers: Array) -> Array:
    """J of ten numbers."""
    mass, *moment = numbers[:4]
    xx, yy, zz, xy, xz, yz = numbers[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    found = np.zeros((4, 4))
    found[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    found[:3, 3] = found[3, :3] = moment
    found[3, 3] = mass
    return found
