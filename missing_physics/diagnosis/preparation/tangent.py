"""Where what a model predicts is linearised, for robots whose base moves freely.

With a fixed base the joints' torques are linear in the inertial numbers. How a free base turns is a ratio of
inertias, which is not: with a payload that nobody told of, the linearisation about the nominal numbers errs
by more than the noise, and effects that are not there make up for it. So where an explanation changes masses
or inertias, the linearisation is made anew about its numbers (Gauss and Newton), and effects are named again.
Only the place of the linearisation changes: what is estimated, and how far it is from nominal, is counted as
before.

Not with flexible links: their vibration follows from the inertial numbers as well, and what a regression
knows of it, quasi-statically, differs from it by more than the noise wherever the linearisation is made.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.preparation.setup import InertialBasis
from missing_physics.diagnosis.preparation.split import Split, split
from missing_physics.diagnosis.terms.term import BODY_NUMBERS, body_terms
from reference_model.effects.base import BodyEffect
from reference_model.evaluation.model import BaseMotion, RobotModel

__all__ = ["about_the_fit", "better"]

Array = NDArray[np.float64]

#: Steps of Gauss and Newton towards the numbers of one explanation.
STEPS = 4
#: A linearisation is good enough when another one would change what is predicted by less than this part of
#: the noise.
PART_OF_NOISE = 0.3
#: Times that a step to numbers of no physical robot is halved.
HALVINGS = 4
#: Poses at which a robot's mass matrix must be positive definite.
POSES = 50


def about_the_fit(
    data: Split, basis: InertialBasis, fit: Explanation, nuisance: bool, *, seed: int
) -> Split | None:
    """`data` linearised about the numbers that the terms of `fit` come to; None where nothing changes.

    Args:
        data: that `fit` was fitted to.
        basis: the combinations of inertial numbers that are estimated.
        fit: an explanation.
        nuisance: whether the inertial combinations are free in it.
        seed: of the noise that is drawn.
    """
    model = data.segments[0].dynamics.model
    if not model.free_base or model.tree.modal:
        return None
    current, changed = data, False
    for _ in range(STEPS):
        about = _numbers(current.segments[0], basis, fit)
        segments = tuple(_about(segment, about) for segment in current.segments)
        apart = _difference(current.segments, segments, about)
        if np.all(apart <= PART_OF_NOISE * current.problem.noise_floor):
            break
        current, changed = split(segments, len(data.problem.segments), basis, seed=seed), True
        fit = explain(current.problem, current.view, fit.terms, nuisance=nuisance)
    return current if changed else None


def better(one: Explanation, other: Explanation) -> bool:
    """Whether `one` explains the same data, linearised elsewhere, better than `other`."""
    energies = [fit.energies * fit.view.scale[fit.problem.usable] ** 2 for fit in (one, other)]
    fall = np.log(np.maximum(energies[1], 1e-300) / np.maximum(energies[0], 1e-300))
    effective = one.effective
    gain = 0.5 * effective @ fall - 0.5 * (one.size - other.size) * np.log(max(effective.sum(), 2.0))
    return bool(gain > 0)


def _about(segment: Segment, about: Array) -> Segment:
    old = segment.dynamics
    return Segment(segment.robot, MotionDynamics(old.model, old.motion, old.further, about), segment.motion)


def _numbers(segment: Segment, basis: InertialBasis, fit: Explanation) -> Array:
    """The inertial numbers of `fit`, with as much of the change as leaves every inertia positive."""
    model, motion = segment.dynamics.model, segment.motion
    still = BaseMotion.at_rest(np.array([1.0, 0.0, 0.0, 0.0]), POSES)
    rows = np.linspace(0, motion.time.size - 1, POSES).astype(int)
    change = _change(model, basis, fit)
    for _ in range(HALVINGS):
        z = model.mass_matrix(motion.position[rows], base=still, inertial=model.inertial + change)
        if np.linalg.eigvalsh(z).min() > 0:
            return np.asarray(model.inertial + change)
        change /= 2.0
    return np.asarray(model.inertial)


def _change(model: RobotModel, basis: InertialBasis, fit: Explanation) -> Array:
    """How far the inertial numbers of `fit` are from nominal, shape (P,)."""
    change = np.zeros_like(model.inertial)
    if fit.nuisance.size:
        change[basis.columns] += basis.directions @ fit.nuisance
    names = list(model.inertial_names)
    for term in fit.terms:
        if isinstance(term.effect, BodyEffect):
            for number, value in zip(BODY_NUMBERS, body_terms(term)[0]):
                if f"{term.at}.{number}" in names:
                    change[names.index(f"{term.at}.{number}")] += value
    return change


def _difference(old: Sequence[Segment], new: Sequence[Segment], about: Array) -> Array:
    """rms by which predictions at `about` differ between two linearisations, shape (m,)."""
    squares = []
    for before, after in zip(old, new):
        step = about - before.dynamics.about
        linear = before.reduce(before.dynamics.outputs + before.dynamics.regressor @ step)
        squares.append((linear - after.reduce(after.dynamics.outputs)) ** 2)
    return np.asarray(np.sqrt(np.mean(np.concatenate(squares), axis=0)))
