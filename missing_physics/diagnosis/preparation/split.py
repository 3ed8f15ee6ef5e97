"""What is fitted and what is only scored, as one regression problem each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import View
from missing_physics.diagnosis.least_squares.problem import Problem, Segment
from missing_physics.diagnosis.preparation.proof import HeldOut, held_out_blocks
from missing_physics.diagnosis.preparation.setup import InertialBasis, build_problem
from missing_physics.diagnosis.statistics.correlated_errors import effective_samples

__all__ = ["CREDIBLE_CHANGE", "Split", "split"]

Array = NDArray[np.float64]

#: Standard deviation by which an inertial combination may credibly be off, as a part of its own size.
CREDIBLE_CHANGE = 0.3


@dataclass(frozen=True)
class Split:
    """Data of a diagnosis.

    Attributes:
        segments: of all recordings, those that are fitted first.
        problem, train: what is fitted, and its rows, shape (R,).
        validation, scored: what is only scored, and its rows; the same problem where rows are held out.
        view: how errors count in fits.
        held_out: the latter with the scale of the errors.
    """

    segments: tuple[Segment, ...]
    problem: Problem
    train: NDArray[np.bool_]
    validation: Problem
    scored: NDArray[np.bool_]
    view: View
    held_out: HeldOut


def split(segments: Sequence[Segment], fitted: int, basis: InertialBasis, *, seed: int) -> Split:
    """The first `fitted` of `segments` are fitted; of these a part is held out where there are no others."""
    problem = build_problem(segments[:fitted], basis, seed=seed)
    rest = segments[fitted:]
    if rest:
        validation = build_problem(rest, basis, seed=seed)
        train = np.ones(problem.time.size, dtype=bool)
        scored = np.ones(validation.time.size, dtype=bool)
    else:
        validation, scored = problem, held_out_blocks(problem)
        train = ~scored
    scale, memory = _scale(problem, train)
    view = View(scale, train, prior=memory / CREDIBLE_CHANGE**2)
    return Split(
        tuple(segments), problem, train, validation, scored, view, HeldOut(validation, scored, scale)
    )


def _scale(problem: Problem, rows: NDArray[np.bool_]) -> tuple[Array, float]:
    """Error scale of each output, and rows per independent row.

    The scale is what simple friction and free inertia leave, at least the noise.
    """
    speed = np.maximum(np.abs(problem.velocity).max(0), 1e-12)
    scale, memories = np.ones(len(problem.outputs)), [1.0]
    for index, output in enumerate(problem.outputs):
        moving = rows & (problem.sliding[:, index] > 0)
        if not moving.any():
            continue
        simple = [np.ones(problem.time.size)]
        if output.joint is not None:
            velocity = problem.velocity[:, output.joint] / speed[output.joint]
            simple += [np.sign(velocity), velocity, np.abs(velocity)]
        shape = np.column_stack([problem.nuisance[:, index], *simple])[moving]
        target = problem.residual[moving, index]
        left = target - shape @ np.linalg.lstsq(shape, target, rcond=1e-10)[0]
        scale[index] = max(float(np.sqrt(np.mean(left**2))), float(problem.noise_floor[index]), 1e-300)
        memories.append(left.size / effective_samples(left))
    return scale, float(np.mean(memories))
