"""Ensures that at every joint the answer predicts held-out data no worse than the standard model or the file.

A result at some joint in the fitted recordings may not hold in others. If the standard model predicts a joint
better, the joint's effects are removed and its parameters estimated as in the standard model. If that is not
enough, all bodies are re-estimated; as a last resort they are taken from the standard model. If the robot
file predicts a joint better, the joint's effects are removed and its parameters are those of the file.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import BODIES, Hypothesis
from missing_physics.inference import Fit, fitted
from missing_physics.inference.torques.data import TorqueData
from reference_model.effects.base import BodyEffect

__all__ = ["WORSE", "Guarded", "guarded", "worse"]

#: An rms that exceeds another by this factor is worse: two halves of one recording differ by 2 %.
WORSE = 1.02
#: Parameters of a joint that a robot file states.
OF_FILE = ("viscous", "coulomb", "offset", "reflected_inertia")

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Guarded:
    """The reported fit, and the fit that a robot file can represent.

    Attributes:
        fit: the answer.
        file: the answer, or if that has unnamed forces the best one without.
    """

    fit: Fit
    file: Fit


def guarded(data: TorqueData, fit: Fit, standard: Fit, named: Fit | None = None) -> Guarded:
    """The answer, replaced by the standard model or the robot file at joints that these predict better.

    Args:
        data: the rows.
        fit: the most probable hypothesis.
        standard: the fit of the standard model.
        named: the most probable hypothesis without unnamed forces, if the first one has any.
    """
    start = fit if named is None else named
    hypothesis = start.hypothesis
    file = _file(data, hypothesis, start)
    for bodies in (False, True):
        joints = worse(data, file, standard)
        if not joints:
            break
        hypothesis = _standard_at(hypothesis, joints, bodies=bodies)
        file = _file(data, hypothesis, file)
    if worse(data, file, standard):
        hypothesis = _with_bodies_of(data, hypothesis, standard)
        file = _file(data, hypothesis, file)
    hypothesis, file = _no_worse_than_file(data, hypothesis, file)
    if hypothesis is fit.hypothesis or (named is not None and _is_safe(data, fit, standard)):
        return Guarded(fit, file)
    return Guarded(_with_unnamed_forces(data, hypothesis, fit), file)


def _is_safe(data: TorqueData, fit: Fit, standard: Fit) -> bool:
    """Whether neither the standard model nor the robot file predicts any joint better."""
    by_file = _larger(data, _held_out(data, fit.errors), _errors_of_file(data))
    return not by_file and not worse(data, fit, standard)


def _with_unnamed_forces(data: TorqueData, hypothesis: Hypothesis, fit: Fit) -> Fit:
    """The fit of a hypothesis, with the unnamed forces of another one unless it predicts better without."""
    plain = _possible(data, hypothesis, fit)
    present = {term.key for term in hypothesis.terms}
    lost = [term for term in fit.hypothesis.terms if term.effect.is_unknown and term.key not in present]
    if not lost:
        return plain
    along = {f"{term.at}.{name}" for term in lost for name in term.effect.along}
    wider = replace(
        hypothesis,
        terms=(*hypothesis.terms, *lost),
        from_file=hypothesis.from_file - along,
        held=tuple(pair for pair in hypothesis.held if pair[0] not in along or pair[1] == 0.0),
    )
    more = _possible(data, wider, fit)
    return plain if worse(data, more, plain) else more


def _with_bodies_of(data: TorqueData, hypothesis: Hypothesis, standard: Fit) -> Hypothesis:
    """The hypothesis with the bodies of the standard model."""
    layout = data.layout
    names = [
        name for body in layout.bodies for name, free in zip(layout.names[body], layout.free[body]) if free
    ]
    return hypothesis.holding({name: standard.parameter(name) for name in names})


def _no_worse_than_file(data: TorqueData, hypothesis: Hypothesis, file: Fit) -> tuple[Hypothesis, Fit]:
    """The hypothesis with the file's parameters at joints that the file predicts better, and its fit."""
    by_file, restored = _errors_of_file(data), set[str]()
    while more := set(_larger(data, _held_out(data, file.errors), by_file)) - restored:
        restored |= more
        hypothesis = _with_file_at(data, hypothesis, more)
        file = _file(data, hypothesis, file)
    return hypothesis, file


def _file(data: TorqueData, hypothesis: Hypothesis, start: Fit) -> Fit:
    """The fit of the hypothesis without unnamed forces, which a robot file can represent.

    Events are kept, so that the other parameters are not biased by them.
    """
    kept = tuple(term for term in hypothesis.terms if not term.effect.is_unknown)
    if len(kept) == len(hypothesis.terms) and hypothesis is start.hypothesis:
        return start
    return _possible(data, replace(hypothesis, terms=kept), start)


def _possible(data: TorqueData, hypothesis: Hypothesis, start: Fit) -> Fit:
    """The fit, without effects whose estimates are impossible in this hypothesis."""
    made = fitted(data, hypothesis, start)
    while made.impossible:
        fewer = made.hypothesis
        for term in made.hypothesis.terms:
            fewer = fewer.less(term) if term.key in made.impossible else fewer
        made = fitted(data, fewer, start)
    return made


def worse(data: TorqueData, made: Fit, other: Fit) -> list[str]:
    """Joints whose held-out error is larger than that of another fit, such as the standard model's.

    Args:
        data: the rows.
        made: the fit.
        other: the other fit.
    """
    return _larger(data, _held_out(data, made.errors), _held_out(data, other.errors))


def _larger(data: TorqueData, ours: Array, theirs: Array) -> list[str]:
    """Joints at which one squared error exceeds another, (n,) each, both with the error of any model."""
    floor = data.error**2 * data.counts[~data.fitted_blocks].sum(axis=0)
    return [j for j, a, b in zip(data.joints, ours + floor, theirs + floor) if a > WORSE**2 * b]


def _held_out(data: TorqueData, errors: Array) -> Array:
    """Squared error of each joint in held-out blocks, shape (n,), from the errors of all blocks, (B, n)."""
    return np.asarray(errors[~data.fitted_blocks].sum(axis=0))


def _errors_of_file(data: TorqueData) -> Array:
    """Squared error of the robot file at each joint in held-out blocks, shape (n,)."""
    found = np.zeros(len(data.joints))
    for run in range(len(data.runs)):
        held_out = data.counted(run) & ~data.fitted_rows(run)[:, None]
        found += np.sum(np.where(held_out, data.target(run) - data.nominal(run), 0.0) ** 2, axis=0)
    return found


def _with_file_at(data: TorqueData, before: Hypothesis, joints: Collection[str]) -> Hypothesis:
    """The hypothesis with the effects and parameters of the robot file at some joints."""
    found = before
    for term in before.terms:
        if term.at.split(".")[0] in joints and not term.is_given:
            found = found.without(term)
    names = data.layout.names
    own = [name for name in names if name.split(".")[0] in joints and name.split(".")[1] in OF_FILE]
    return found.holding({name: float(data.file_values[names.index(name)]) for name in own})


def _standard_at(before: Hypothesis, joints: Collection[str], *, bodies: bool) -> Hypothesis:
    """The hypothesis with the standard model at some joints."""
    found = before
    for term in before.terms:
        is_body = bodies and isinstance(term.effect, BodyEffect) and term.effect.place == "link"
        if term.at.split(".")[0] in joints or is_body:
            found = found.without(term)
    freed = {name for name in found.from_file if name.split(".")[0] in joints}
    return replace(found, from_file=found.from_file - freed - ({BODIES} if bodies else set()))
