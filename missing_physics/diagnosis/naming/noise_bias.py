"""What the noise of the encoders does to the parameters of a hidden mode, taken back.

A mode is simulated along the recorded motion, whose noise shakes it as well. So noise is in the regressors
and in the residual at once: least squares prefers a stronger damping, with which the mode is shaken less. To
first order in the noise's power the estimate solves X'r = 0 where X'r = E[dX' dr] should be, dX what noise
adds to the derivatives and dr to the residual. Both are known: noise of the encoders' size is sent through
the same filters and the same mode, and the mean of dX' dr is taken over some draws (corrected score; Carroll,
Ruppert, Stefanski, Crainiceanu, Measurement Error in Nonlinear Models (2006), ch. 7). One step is taken: what
noise does grows as the damping falls, so that more steps would run away where there is much of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.diagnosis.candidates.structural import hidden
from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.motion.low_pass import LowPass
from missing_physics.diagnosis.terms.term import Term

__all__ = ["evidence_without_noise", "without_noise_bias"]

Array = NDArray[np.float64]

#: Draws of the noise: a mean over as many times the number of the mode's memories in the recording.
DRAWS = 6


def without_noise_bias(fitted: Explanation, *, seed: int = 0) -> Explanation:
    """The same explanation at the parameters that least squares would have come to without that bias."""
    terms = [term for term in fitted.found if hidden(term.effect) and term.free]
    if not terms:
        return fitted
    wanted = np.zeros(fitted.columns.shape[1])
    for term in terms:
        wanted[fitted.slice_of(term)] = _score(fitted, term, seed)
    # X'(r - X change) = wanted + prior (nuisance + change)
    prior = np.zeros(wanted.size)
    prior[: fitted.nuisance.size] = fitted.view.prior
    values = np.concatenate([fitted.nuisance, *(t.values for t in fitted.terms)])
    aim = fitted.columns.T @ fitted.errors[:, 0] - wanted - prior * values
    gram = fitted.columns.T @ fitted.columns + np.diag(prior)
    size = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    change = np.linalg.lstsq(gram / np.outer(size, size), aim / size, rcond=1e-10)[0] / size
    moved = _at(fitted, values + change)
    if any(_at_bound(t) for t in moved.found if hidden(t.effect)):
        return fitted  # more noise than mode: nothing to first order helps
    return moved


def evidence_without_noise(fitted: Explanation, simpler: Explanation, term: Term, *, seed: int = 0) -> float:
    """`Explanation.evidence_over`, less what `term` takes away of the encoders' noise in the torques needed.

    A mode that is damped enough follows that noise and undoes a part of it, whether it is there or not.
    """
    problem, view, chance = fitted.problem, fitted.view, np.random.default_rng(seed)
    width, taken = int(problem.usable.sum()), np.zeros(int(problem.usable.sum()))
    for _ in range(DRAWS):
        parts = [_shaken(segment, term, chance) for segment in problem.segments]
        rigid, moved = (np.concatenate(kind)[:, :, :1] for kind in zip(*parts))
        for sign, torques in ((1.0, rigid), (-1.0, moved)):
            rows = view.flatten(problem, torques).reshape(-1, width)
            taken += sign * (rows**2).sum(axis=0) / DRAWS
    left = fitted.energies + np.clip(taken, 0.0, np.maximum(simpler.energies - fitted.energies, 0.0))
    lost = np.log(left / np.maximum(fitted.energies, 1e-300))
    return fitted.evidence_over(simpler) - float(0.5 * fitted.effective @ lost)


def _at_bound(term: Term) -> bool:
    return bool(np.any(term.values <= term.bounds[0]) or np.any(term.values >= term.bounds[1]))


def _at(explanation: Explanation, values: Array) -> Explanation:
    """The explanation with other values of everything that is estimated."""
    problem, view, start = explanation.problem, explanation.view, explanation.nuisance.size
    nuisance, terms = values[:start], []
    for term in explanation.terms:
        stop = start + len(term.free)
        free = np.array([name not in term.held for name in term.free], dtype=bool)
        terms.append(term.at_values(np.where(free, values[start:stop], term.values)))
        start = stop
    value, jacobian = problem.evaluate(terms)
    inertial = problem.nuisance if nuisance.size else np.zeros((*value.shape, 0))
    columns = view.flatten(problem, np.concatenate([inertial, jacobian], axis=2))
    residual = problem.residual - view.known(problem) - value - inertial @ nuisance
    return replace(explanation, terms=tuple(terms), nuisance=nuisance, residual=residual, columns=columns)


def _score(explanation: Explanation, term: Term, seed: int) -> Array:
    """E[dX' dr] of the free parameters of `term`."""
    problem, view = explanation.problem, explanation.view
    chance = np.random.default_rng(seed)
    total = np.zeros(len(term.free))
    for _ in range(DRAWS):
        made = np.concatenate([_shaken(segment, term, chance)[1] for segment in problem.segments])
        columns = view.flatten(problem, made[:, :, 1:])
        total += columns.T @ view.flatten(problem, -made[:, :, :1])[:, 0]
    return total / DRAWS


def _shaken(segment: Segment, term: Term, chance: np.random.Generator) -> tuple[Array, Array]:
    """What one draw of the encoders' noise adds to the prediction.

    Returns:
        Of the robot as described, (M, m, 1); of the one with the mode and its derivatives, (M, m, 1 + k).
    """
    motion = segment.motion
    recorded = motion.drawn_noise(chance)
    position = LowPass(motion.low_pass.rate, motion.motion_cutoff).smooth(recorded)
    spline = make_interp_spline(motion.time, position, k=5)
    errors = (position, spline(motion.time, 1), spline(motion.time, 2))
    rigid = segment.reduce(segment.dynamics.moved([error[:, :, None] for error in errors]))
    modes = segment.hidden.modes(*term.key)
    assert modes is not None
    values = (term.parameters[name] for name in modes.names)
    made = modes.respond(*values, force=modes.pushed_by(errors[2]))
    value, *derivatives = (segment.reduce(part[:, :, :1]) for part in made)
    by = dict(zip(modes.names, derivatives))
    columns = [by.get(name, np.zeros_like(value)) for name in term.free]
    return rigid, np.concatenate([rigid + value, *columns], axis=2)
