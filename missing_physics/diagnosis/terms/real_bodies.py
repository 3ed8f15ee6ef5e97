"""Inertial numbers of real bodies that do what the data ask of combinations of them.

Data fix combinations of masses, first moments and inertias only (base parameters), and leave the others where
they were; body by body the result may have a negative inertia. Of real bodies the nearest to what is asked,
in units of its uncertainty, are found (`bodies.realisable`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from missing_physics.bodies.realisable import BODY_NUMBERS, nearest, parts_of
from missing_physics.diagnosis.terms.term import Term
from reference_model.dynamics.inertial import ten_numbers
from robot_model import Robot

__all__ = ["UNREAL", "nearest_real", "unreal"]

Array = NDArray[np.float64]

#: Why names go with which a body would not be real.
UNREAL = "beside what else is named a body would need mass properties that no body like the described one has"
#: Where what is asked has to be left by more than its uncertainty explains with this chance, no body is real.
CHANCE = 1e-3
#: Weight of a number's whole typical size beside one standard deviation of what is asked.
CLOSE = 0.1
#: The last weight of the barrier.
LAST = 1e-4
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
    parts = list(parts_of(names, scale))
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
    numbers = nearest(parts, described, seen, asked, close=CLOSE, last=LAST)
    if numbers is None:
        return None
    off = seen @ numbers - asked
    if float(off @ off) > chi2.isf(CHANCE, len(wanted)):
        return None
    return np.asarray((numbers - described) * scale)
