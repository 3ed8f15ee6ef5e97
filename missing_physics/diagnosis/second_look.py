"""A second look, at the cut-off where a mismatch shows most clearly, when the first look could name nothing.

The first cut-off keeps the noise of a motion that is differentiated twice small beside the torque, at every
joint. It says nothing of the mismatch: what is brief, or turns fast with the position, may lie above it, the
more so where heavy links make much torque of an encoder's noise, or one joint is hardly driven. Noise grows
with the cut-off, and so does the number of samples that tell of the mismatch. With N independent samples at
a joint, r the mean square of what the robot's description leaves there, and f that of noise, the logarithm
of the odds that something is there grows as N/2 log(r/f). Of the wider cut-offs at which the mismatch is
beyond noise the one is taken at which this is largest, over all joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import View, explain
from missing_physics.diagnosis.least_squares.problem import Problem, Segment
from missing_physics.diagnosis.location.residual import FLOOR_TOLERANCE, locate
from missing_physics.diagnosis.motion.low_pass import SAMPLES_PER_PERIOD
from missing_physics.diagnosis.naming.judge import beyond_noise
from missing_physics.diagnosis.preparation.setup import (
    InertialBasis,
    build_problem,
    make_segments,
    nominal_terms,
)
from missing_physics.results.result import Result
from robot_model import Recording, Robot

__all__ = ["clarity", "clearer_cutoff", "named_by", "nameless"]

Array = NDArray[np.float64]

#: Cut-offs that are tried, as multiples of the first.
WIDER = (2.5, 6.25)
#: A cut-off that is not wider by this factor shows nothing new.
LEAST_WIDER = 1.5
#: A low-pass passes two independent samples per period of its cut-off.
INDEPENDENT = 2.0 / SAMPLES_PER_PERIOD


def clearer_cutoff(
    robot: Robot, recordings: Sequence[Recording], segments: Sequence[Segment], *, seed: int
) -> float | None:
    """The wider cut-off at which what the robot leaves stands out most clearly [Hz].

    Args:
        robot: as described.
        recordings: those that are fitted.
        segments: along these, at the first cut-off.
        seed: of the drawn noise.

    Returns:
        None where nothing is beyond noise at any wider cut-off.
    """
    motions = [segment.motion for segment in segments]
    first = min(motion.low_pass.cutoff for motion in motions)
    highest = min(motion.highest_cutoff for motion in motions)
    best, clearest = None, 0.0
    for cutoff in sorted({min(factor * first, highest) for factor in WIDER}):
        if cutoff <= LEAST_WIDER * first:
            continue
        basis = InertialBasis((), np.zeros(0, int), np.zeros((0, 0)), np.zeros(0))
        problem = build_problem(make_segments(robot, recordings, cutoff=cutoff), basis, seed=seed)
        left = _left(problem)
        found = clarity(problem, left)
        if found > clearest and beyond_noise(locate(problem, robot, left)):
            best, clearest = cutoff, found
    return best


def _left(problem: Problem) -> Array:
    """What the robot as described leaves of the torques, shape (R, m)."""
    view = View(np.ones(len(problem.outputs)), np.ones(problem.time.size, dtype=bool))
    terms = [replace(term, frozen=True) for term in nominal_terms(problem.robot)]
    return explain(problem, view, terms, nuisance=False).residual


def clarity(problem: Problem, left: Array) -> float:
    """Logarithm of the odds, over all usable outputs, that `left`, shape (R, m), is more than noise."""
    counted = problem.sliding.sum(axis=0)
    mean = (left**2 * problem.sliding).sum(axis=0) / np.maximum(counted, 1.0)
    ratio = mean / np.maximum(FLOOR_TOLERANCE * problem.noise_floor, 1e-300) ** 2
    gain = 0.5 * INDEPENDENT * counted * np.log(np.maximum(ratio, 1.0))
    return float(gain[problem.usable].sum())


def nameless(result: Result) -> bool:
    """Whether something differs and nothing was named."""
    return result.diagnosis.verdict == "unexplained" and not result.diagnosis.findings


def named_by(first: Result, second: Result) -> Result:
    """The second look where it names what differs, with a note that says so; else the first."""
    diagnosis = second.diagnosis
    if not diagnosis.findings or diagnosis.verdict == "unexplained":
        return first
    why = "A lower cut-off was tried first; the mismatch could not be named there."
    return replace(second, diagnosis=replace(diagnosis, notes=(*diagnosis.notes, why)))
