"""Fit of one hypothesis: weighted least squares, linearised about its present parameters until they converge.

The contribution of a term to the recorded torques is linear in its parameters, or linearised about their
present values (Gauss-Newton). The parameters of the standard model are fitted together with them, with the
priors of `missing_physics.standard`: physically consistent bodies and non-negative friction. Parameters that
a hypothesis takes from the robot file have a prior around the file's value.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import BODIES, Hypothesis, Term, not_credible
from missing_physics.inference.data import HELD_OUT, Data
from missing_physics.inference.problem import Problem
from missing_physics.standard.fit import FILE, minimise, objective, residual_rms
from missing_physics.standard.layout import Layout
from missing_physics.standard.model import AGREED, HALVINGS

__all__ = ["FILE", "RIDGE", "Fit", "contributions", "fitted", "of_one_fold", "refiled", "residuals"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Most rounds of Gauss-Newton, and those of a linear hypothesis: weights and parameters converge in three.
ROUNDS, LINEAR = 10, 3
#: A non-linear parameter moves by at most this part of itself in one round.
LARGEST = 0.7
#: and one that may have either sign by the same part of at least this part of its typical size.
EITHER_SIGN = 0.1
#: Ridge of normal equations, as a part of their mean diagonal: far above rounding, and far below what data
#: determine.
RIDGE = 1e-9
#: Part of the information on a parameter that one fold has where the others say less [-].
ONE_FOLD = 0.5
#: Part of the largest force of what acts beyond a place that counts as none: filters leave as much [-].
BEYOND = 0.01


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    Attributes:
        hypothesis: with the estimated parameters.
        numbers: parameters of the standard model, the timing last, shape (X,).
        deviations: standard deviation of every parameter, the terms' last, by the scatter of blocks,
            shape (Y,).
        sigma: rms of the residual of each joint in the fitted rows, shape (n,).
        errors: squared error of each block and joint, predicted without that block, shape (B, n).
        layout: of all parameters, the standard model's first, then the terms'.
        hessian: second derivative of the objective by all free parameters.
        cut: rows of each block and joint in which a term cuts the recorded torque, shape (B, n).
        about: parameters of the standard model about which the rows were linearised in the fit, shape (X,).
        impossible: terms whose numbers nothing can have, with the reason.
        once: terms of which a fold has parameters that no other determines, as of every event.
        partial: whether non-linear parameters of some terms were held in the fit.
    """

    hypothesis: Hypothesis
    numbers: Array
    deviations: Array
    sigma: Array
    errors: Array
    layout: Layout
    hessian: Array
    cut: Array
    about: Array
    impossible: Mapping[tuple[str, str], str]
    once: frozenset[tuple[str, str]] = frozenset()
    partial: bool = False

    def number(self, name: str) -> float:
        """One number of the standard model, or the timing of a joint."""
        return float(self.numbers[self.layout.names.index(name)])

    def deviation(self, name: str) -> float:
        """Standard deviation of one number, a term's as `EFFECT@PLACE.NUMBER`; 0 where it is held."""
        return float(self.deviations[self.layout.names.index(name)])


def fitted(data: Data, hypothesis: Hypothesis, start: Fit | None = None, place: str | None = None) -> Fit:
    """Fit a hypothesis to the recordings that are fitted, and predict every block without it.

    Args:
        data: the rows.
        hypothesis: its terms with starting values.
        start: a fit of a similar hypothesis.
        place: joint where it differs from that; terms of other joints keep the parameters in which they are
            not linear, since joints hardly interact.
    """
    terms = hypothesis.terms
    numbers = data.start if start is None else start.numbers
    sigma = data.sigma if start is None else start.sigma
    moving = [place is None or term.joint == place for term in terms]
    linear = all(term.is_linear(p) for term, own in zip(terms, moving) if own for p in term.free)
    partial = not all(term.is_linear(p) for term, own in zip(terms, moving) if not own for p in term.free)
    width, count = _width(data, hypothesis), data.start.size
    problem = Problem.of(data, hypothesis, numbers)
    for _ in range(LINEAR if linear else ROUNDS):
        found, _ = _bounded(problem, problem.freeing(moving), sigma, width)
        sigma = residual_rms(problem.total, found)
        change = found[count:]
        whole = problem.total
        gained = _weighted(whole.energy(problem.begin) - whole.energy(found), sigma)
        still = gained < AGREED
        numbers = found[:count]
        if still and not terms:
            continue
        aim = _weighted(whole.energy(problem.begin) if linear else problem.energy_at(numbers), sigma)
        for halved in range(1 if linear else HALVINGS):
            moved = _moved(terms, change)
            # The derivatives of a step that is not taken are not needed.
            if not halved or _weighted(_energy(data, moved, problem.begin[:count]), sigma) <= aim:
                problem = Problem.of(data, replace(hypothesis, terms=moved), numbers)
                if linear or _weighted(problem.total.energy(problem.begin), sigma) <= aim:
                    break
            change = 0.5 * change
        else:  # no step of this direction helps
            problem = Problem.of(data, replace(hypothesis, terms=terms), numbers)
            break
        terms = moved
        if still:
            break
    found, ends = _bounded(problem, problem.linear, sigma, width)
    return replace(_judged(problem, replace(hypothesis, terms=terms), found, width, ends), partial=partial)


def refiled(data: Data, hypothesis: Hypothesis, start: Fit) -> Fit:
    """A fit that differs from another only in the parameters it takes from the file: one step from there."""
    problem = Problem.of(data, replace(hypothesis, terms=start.hypothesis.terms), start.numbers)
    width = _width(data, hypothesis)
    found, ends = _bounded(problem, problem.linear, start.sigma, width)
    made = _judged(problem, replace(hypothesis, terms=start.hypothesis.terms), found, width, ends)
    return replace(made, partial=start.partial)


def _width(data: Data, hypothesis: Hypothesis) -> float:
    """Relative width of the bodies' prior."""
    own = data.width
    return min(own, hypothesis.accuracy or FILE) if BODIES in hypothesis.filed else own


def _energy(data: Data, terms: Sequence[Term], numbers: Array) -> Array:
    """Squared residual of each joint in the fitted rows, shape (n,)."""
    left = [data.target(run) - data.terms.contributed(terms, run) for run in range(data.fitted)]
    for run, own in enumerate(left):
        for k, (acts, columns) in enumerate(zip(data.acts, data.own[run])):
            own[:, k] -= columns @ numbers[acts]
    return np.asarray(sum(np.sum(left[run][rows] ** 2, axis=0) for run, rows in data.stretches()))


def _weighted(energy: Array, sigma: Array) -> float:
    return float(np.sum(energy / sigma**2))


def _bounded(problem: Problem, layout: Layout, sigma: Array, width: float) -> tuple[Array, Mask]:
    """The minimum at which no parameter of a term leaves its range, and which of them are at its end.

    A parameter that would leave it is held at the end and the others are fitted again (active set).

    Args:
        problem: the normal equations.
        layout: which parameters are free.
        sigma, width: see `minimise`.

    Returns:
        All parameters, and which are held, shape (Y,) each.
    """
    first, begin, held = problem.data.start.size, problem.begin.copy(), np.zeros_like(layout.free)
    for _ in range(1 + begin.size - first):
        own = replace(layout, free=layout.free & ~held)
        found = minimise(own, problem.total, sigma, width, begin)
        outside, ends = _outside(problem.terms, found[first:])
        more = np.concatenate([np.zeros(first, dtype=bool), outside]) & own.free
        if not more.any():
            break
        held |= more
        begin[np.flatnonzero(more)] = ends[more[first:]]
    return found, held


def _outside(terms: Sequence[Term], change: Array) -> tuple[Mask, Array]:
    """Which parameters of terms changes would take out of their range, and the changes to its end."""
    each = [(term, p) for term in terms for p in term.free]
    before = np.array([term.parameters[p.name] for term, p in each])
    after, ends, at = before + change, before + change, 0
    for term in terms:
        free = [p.name for p in term.free]
        wanted = dict(zip(free, ends[at : at + len(free)]))
        inside = term.moved(wanted).parameters
        ends[at : at + len(free)] = [inside[name] for name in free]
        at += len(free)
    return ends != after, ends - before


def _judged(problem: Problem, hypothesis: Hypothesis, x: Array, width: float, ends: Mask) -> Fit:
    """Errors of all blocks; those of each fold by one Newton step from the whole fit to that without it.

    Events keep their parameters, since no other fold determines them; their prior odds account for that. So
    do effects beyond a place that is seldom reached. Parameters at the end of their range, `ends`, stay.
    """
    data, layout, whole = problem.data, problem.layout, problem.total
    sigma = residual_rms(whole, x)
    free, weight = layout.free, 1.0 / sigma**2
    hessian = objective(layout, whole, sigma, width, x)[2][np.ix_(free, free)]
    kept = _kept(problem, weight)
    moves = (~np.concatenate([np.zeros((len(kept), data.start.size), dtype=bool), kept], axis=1) & ~ends)[
        :, free
    ]
    apart = {HELD_OUT: x}
    for again, (f, part) in zip(moves, problem.folds.items()):
        open_ = np.flatnonzero(free)[again]
        length = layout.size[open_]
        away = x.copy()
        gram, right = part.weighted(weight)
        slope = (gram @ x - right)[open_]
        matrix = (hessian[np.ix_(again, again)] - gram[np.ix_(open_, open_)]) * np.outer(length, length)
        matrix += RIDGE * max(np.trace(matrix) / max(len(matrix), 1), 1e-300) * np.eye(len(matrix))
        away[open_] += length * np.linalg.solve(matrix, length * slope)
        apart[f] = away
    errors = problem.errors(apart)
    deviations = _deviation(problem, x, hessian, sigma)
    moved = replace(hypothesis, terms=_moved(hypothesis.terms, x[data.start.size :]))
    gone = data.cut(moved.terms)
    return Fit(
        moved,
        x[: data.start.size],
        deviations,
        sigma,
        errors,
        layout,
        hessian,
        gone,
        data.about_numbers,
        dict(_impossible(data, moved.terms, x[: data.start.size], gone)),
        frozenset(term.key for term, own in zip(hypothesis.terms, _of_each(hypothesis.terms, kept)) if own),
    )


def _kept(problem: Problem, weight: Array) -> Mask:
    """Which parameters of terms a fit without one fold keeps, as no other determines them: shape (F, P)."""
    widths = [len(term.free) for term in problem.terms]
    event, beyond = (
        np.repeat([flag(term.effect) for term in problem.terms], widths).astype(bool)
        for flag in (lambda effect: effect.is_event, lambda effect: effect.is_beyond)
    )
    kept = np.tile(event, (len(problem.folds), 1))
    if beyond.any():
        first = problem.data.start.size
        parts = [np.diag(part.weighted(weight)[0])[first:] for part in problem.folds.values()]
        kept |= of_one_fold(np.array(parts)) & beyond
    return kept


def of_one_fold(information: Array) -> Mask:
    """Parameters that one fold determines better than the others together, by that fold: shape (F, P).

    Args:
        information: on each, shape (F, P).
    """
    return np.asarray(information > ONE_FOLD * np.maximum(information.sum(axis=0), np.finfo(float).tiny))


def _of_each(terms: Sequence[Term], kept: Mask) -> Iterator[bool]:
    """Whether any parameter of each term is kept in any fold."""
    at = 0
    for term in terms:
        yield bool(kept[:, at : at + len(term.free)].any())
        at += len(term.free)


def _impossible(
    data: Data, terms: Sequence[Term], numbers: Array, gone: Array
) -> Iterator[tuple[tuple[str, str], str]]:
    """Terms whose numbers nothing can have, with the reason.

    Args:
        data: the rows.
        terms: as fitted.
        numbers: of the standard model, shape (X,).
        gone: rows in which terms cut the torque, shape (B, n).
    """
    for term in terms:
        joint, needed = term.at.split(".")[0], 0.0
        if joint in data.joints:
            k = data.joints.index(joint)
            made = (own[k] @ numbers[data.acts[k]] for own in data.own)
            needed = max(float(np.abs(one).max()) for one in made)
        why = not_credible(term, data.robot, needed)
        if not why and term.effect.cuts_torque:
            k = data.joints.index(term.at)
            rows, cut = float(data.counts[:, k].sum()), float(gone[:, k].sum())
            if cut > rows - cut:
                why = f"the drive would be at its limit {cut / rows:.0%} of the time, and follow no command"
        if not why and term.effect.is_beyond:
            acts = [np.abs(data.columns(term, run)[:, :, 0]) for run in range(data.fitted)]
            least = BEYOND * max(float(one.max(initial=0.0)) for one in acts)
            share = float(np.mean(np.concatenate([(one > least).any(axis=1) for one in acts])))
            if share > 0.5:
                why = f"it would act {share:.0%} of the time, as a spring does"
        if why:
            yield term.key, why


def _deviation(problem: Problem, x: Array, hessian: Array, sigma: Array) -> Array:
    """Standard deviations, shape (Y,): of the sandwich, and no less than of independent errors.

    The sandwich of the blocks' scores and the prior holds whatever the errors within a block are, but says
    nothing of parameters that a single block determines, such as an event's. Independent are as many errors
    as the band has room for; that of any model is one of them.
    """
    weight = 1.0 / sigma**2
    free, size = problem.layout.free, problem.layout.size[problem.layout.free]
    scaled = np.outer(size, size)
    scores = problem.scores(x, weight)[:, free] * size
    scores -= scores.mean(axis=0)
    inverse = np.linalg.pinv(hessian * scaled, hermitian=True)
    factor = len(scores) / max(len(scores) - 1, 1)
    rows = problem.total.weighted(weight)[0][np.ix_(free, free)]
    prior = (hessian - rows) * scaled
    variance = factor * np.sum((scores @ inverse) ** 2, axis=0) + np.einsum(
        "xy,yz,zx->x", inverse, prior, inverse, optimize=True
    )
    least = problem.data.independent / (sigma**2 + problem.data.error**2)
    known = problem.total.weighted(least)[0][np.ix_(free, free)] * scaled + prior
    variance = np.maximum(variance, np.diag(np.linalg.pinv(known, hermitian=True)))
    found = np.zeros(x.size)
    found[free] = size * np.sqrt(np.maximum(variance, 0.0))
    if problem.layout.scale.any():  # in proportion to the file's bodies
        own = problem.data.layout.own
        found[own] = np.where(found[own] > 0.0, np.hypot(found[own], FILE * x[own]), 0.0)
    return found


def _moved(terms: Sequence[Term], change: Array) -> tuple[Term, ...]:
    """Terms with changed parameters; non-linear ones change by at most a part of themselves."""
    found, at = [], 0
    for term in terms:
        values = {}
        for p, step in zip(term.free, change[at : at + len(term.free)]):
            before = term.parameters[p.name]
            least = 1e-3 if p.lower >= 0.0 else EITHER_SIGN  # may pass through zero
            limit = np.inf if p.linear else LARGEST * max(abs(before), least * p.typical)
            values[p.name] = before + float(np.clip(step, -limit, limit))
        at += len(term.free)
        found.append(term.moved(values))
    return tuple(found)


def contributions(data: Data, fit: Fit, number: int) -> Array:
    """Torques that a fit predicts in one recording, shape (K, n)."""
    found = data.designs[number] @ fit.numbers
    for term in fit.hypothesis.terms:
        found = found + data.columns(term, number)[:, :, 0]
    return np.asarray(found)


def residuals(data: Data, fit: Fit, number: int) -> Array:
    """Residual of a fit in one recording, zero where nothing is compared, shape (K, n)."""
    return np.where(data.counted(number), data.target(number) - contributions(data, fit, number), 0.0)
