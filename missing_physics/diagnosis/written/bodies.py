"""Inertial numbers of the robot file: those with which an explanation predicts what it states."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from missing_physics.bodies.written import as_real_bodies
from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.preparation.setup import InertialBasis, typical_sizes
from missing_physics.diagnosis.preparation.split import Split
from reference_model.dynamics.inertial import nominal_inertial
from robot_model import Robot

__all__ = ["NEAREST", "NOT_REAL", "with_bodies_of"]

Array = NDArray[np.float64]

#: A deviation of what is predicted starts to matter where its energy is this part of what the explanation
#: leaves: it changes the rms by half of that.
MATTERS = 1e-3
#: and where it is this part of what was recorded, in recordings that are explained to the last digit.
EXACT = 1e-6
#: So many times that energy changes the rms by a hundredth.
FAR = 20.0
#: Said where no real bodies do what was estimated, and where none do so even nearly.
NEAREST = (
    "the re-estimated mass properties are those of no real bodies; the robot file has the nearest that are, "
    "and errors are stated with these"
)
NOT_REAL = "no real bodies have nearly the re-estimated mass properties; the robot file has the nominal ones"


def with_bodies_of(
    robot: Robot, basis: InertialBasis, data: Split, explanation: Explanation
) -> tuple[Robot, str]:
    """`robot` with the masses, centres, inertias and rotors by which an explanation predicts.

    Data tell combinations of these numbers alone; of all that are equivalent the robot gets the one nearest
    to its own, and where that is none of real bodies, the nearest that is.

    Args:
        robot: with the effects of the explanation.
        basis: the combinations.
        data: along whose motions predictions have to agree.
        explanation: with values of the combinations.

    Returns:
        The robot, and a sentence where it predicts otherwise.
    """
    told = explanation.view.told
    values = explanation.nuisance if told is None else told.values
    model = data.segments[0].dynamics.model
    change = np.zeros(len(model.inertial_names))
    change[basis.columns] = basis.first(values.size) @ values
    if not change.any():
        return robot, ""
    free = np.zeros(change.size, dtype=bool)
    free[basis.columns] = True
    weight = _deviations(data, explanation, basis.columns)
    scale = typical_sizes(robot, model)
    found = as_real_bodies(robot, change, scale=scale, free=free, weight=weight)
    if found is None:
        return robot, NOT_REAL
    off = weight @ (nominal_inertial(found) - model.inertial - change)
    return found, NEAREST if float(off @ off) > FAR else ""


def _deviations(data: Split, explanation: Explanation, columns: NDArray[np.int_]) -> Array:
    """Rows w of which |w x|^2 is how much a change x of all numbers moves predictions, shape (P', P).

    One where that starts to matter, by its mean over the samples of each output.
    """
    size = len(data.segments[0].dynamics.model.inertial_names)
    gram = np.zeros((columns.size, columns.size))
    usable = data.problem.usable
    levels = np.sqrt(np.mean(explanation.residual[data.train] ** 2, axis=0))
    recorded = np.sqrt(np.mean(data.problem.measured**2, axis=0))
    levels = np.maximum(MATTERS**0.5 * np.maximum(levels, data.problem.noise_floor), EXACT**0.5 * recorded)
    for problem in _problems(data):
        for segment in problem.segments:
            rows = segment.reduce(segment.dynamics.regressor[:, :, columns])[:, usable]
            rows = rows / np.maximum(levels[usable], 1e-300)[:, None] / np.sqrt(problem.time.size)
            flat = rows.reshape(-1, columns.size)
            gram += flat.T @ flat
    values, vectors = np.linalg.eigh(gram)
    weight = np.zeros((columns.size, size))
    weight[:, columns] = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return weight


def _problems(data: Split) -> Iterator[Problem]:
    yield data.problem
    if data.validation is not data.problem:
        yield data.validation
