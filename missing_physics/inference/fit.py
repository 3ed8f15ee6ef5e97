"""Fit of one hypothesis by weighted least squares, with Gauss-Newton steps in non-linear parameters.

The contribution of a term to the recorded torques is linear in its parameters, or linearised at their present
values. The parameters of the standard model are fitted together with those of the terms, with the priors of
`missing_physics.standard`: physically consistent bodies and non-negative friction. A parameter that a
hypothesis takes from the robot file has a prior around the file's value.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import BODIES, Hypothesis, Term, not_credible
from missing_physics.inference.data import BLOCKS, HELD_OUT, Data
from missing_physics.inference.problem import Problem
from missing_physics.standard.fit import FILE, minimise, objective, residual_rms
from missing_physics.standard.layout import Layout
from missing_physics.standard.model import AGREED, HALVINGS

__all__ = [
    "FILE",
    "RIDGE",
    "Fit",
    "contributions",
    "fitted",
    "of_one_fold",
    "residuals",
    "variance_of_sum",
    "with_other_file_parameters",
]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Most Gauss-Newton rounds, and rounds of a linear hypothesis: weights and parameters converge in three.
ROUNDS, LINEAR = 10, 3
#: A non-linear parameter changes by at most this fraction of its value in one round.
LARGEST = 0.7
#: One that may have either sign changes by that fraction of at least this fraction of its typical value.
EITHER_SIGN = 0.1
#: Ridge of the normal equations, as a fraction of their mean diagonal: far above rounding, and far below the
#: information in data.
RIDGE = 1e-9
#: Fraction of the information on a parameter above which one fold holds more than all others together [-].
ONE_FOLD = 0.5
#: Forces below this fraction of the largest one count as zero: filters leave as much [-].
BEYOND = 0.01


@dataclass(frozen=True)
class Precision:
    """What rows tell about the parameters of a term, relative to what is known of them in advance.

    Attributes:
        matrix: information of independent rows, other parameters estimated too, in units of the inverse
            square of the prior's width, shape (P, P).
        joints: fraction of it from each joint, shape (n,).
    """

    matrix: Array
    joints: Array

    def price(self, shares: Array) -> float:
        """Loss of log evidence by the volume of the prior that the rows exclude [nats].

        Args:
            shares: ratio of independent to all rows at each joint, shape (n,).
        """
        known = float(self.joints @ shares) * self.matrix
        return 0.5 * float(np.linalg.slogdet(np.eye(len(known)) + known)[1])


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    Attributes:
        hypothesis: with the estimated parameters of its terms.
        parameters: of the standard model, the delays last, shape (X,).
        deviations: standard deviation of every parameter, the terms' last, from the scatter of blocks,
            shape (Y,).
        sigma: rms of the residual of each joint in the fitted rows, shape (n,).
        errors: squared error of each block and joint, predicted without its fold, shape (B, n).
        layout: of all parameters, the standard model's first, then the terms'.
        hessian: second derivative of the objective by all free parameters.
        cut: number of rows of each block and joint in which a term saturates the torque, shape (B, n).
        about: standard model parameters at which the rows were linearised in the fit, shape (X,).
        impossible: terms with physically impossible parameters, with the reason.
        once: of terms with parameters that a single fold determines, such as every event, how precisely the
            rows determine these.
        partial: whether non-linear parameters of some terms were held fixed in the fit.
    """

    hypothesis: Hypothesis
    parameters: Array
    deviations: Array
    sigma: Array
    errors: Array
    layout: Layout
    hessian: Array
    cut: Array
    about: Array
    impossible: Mapping[tuple[str, str], str]
    once: Mapping[tuple[str, str], Precision] = field(default_factory=dict)
    partial: bool = False

    def parameter(self, name: str) -> float:
        """Estimate of one parameter of the standard model, or of a joint's delay."""
        return float(self.parameters[self.layout.names.index(name)])

    def deviation(self, name: str) -> float:
        """Standard deviation of a parameter, a term's named `EFFECT@PLACE.PARAMETER`; 0 where it is fixed."""
        return float(self.deviations[self.layout.names.index(name)])


def fitted(data: Data, hypothesis: Hypothesis, start: Fit | None = None, place: str | None = None) -> Fit:
    """Fit a hypothesis to the fitted recordings, and predict every block without its fold.

    Args:
        data: the rows.
        hypothesis: its terms hold starting values.
        start: a fit of a similar hypothesis.
        place: joint where the two differ; terms at other joints keep their non-linear parameters, since
            joints hardly interact.
    """
    terms = hypothesis.terms
    parameters = data.start if start is None else start.parameters
    sigma = data.sigma if start is None else start.sigma
    moving = [place is None or term.joint == place for term in terms]
    linear = all(term.is_linear(p) for term, own in zip(terms, moving) if own for p in term.free)
    partial = not all(term.is_linear(p) for term, own in zip(terms, moving) if not own for p in term.free)
    width, count = _width(data, hypothesis), data.start.size
    problem = Problem.of(data, hypothesis, parameters)
    for _ in range(LINEAR if linear else ROUNDS):
        found, _ = _within_range(problem, problem.freeing(moving), sigma, width)
        sigma = residual_rms(problem.total, found, data.least)
        change = found[count:]
        total = problem.total
        gained = _weighted(total.energy(problem.begin) - total.energy(found), sigma)
        still = gained < AGREED
        parameters = found[:count]
        if still and not terms:
            continue
        aim = _weighted(total.energy(problem.begin) if linear else problem.energy_at(parameters), sigma)
        for halved in range(1 if linear else HALVINGS):
            moved = _updated(terms, change)
            # Derivatives are computed only for steps that are taken.
            if not halved or _weighted(_energy(data, moved, problem.begin[:count]), sigma) <= aim:
                problem = Problem.of(data, replace(hypothesis, terms=moved), parameters)
                if linear or _weighted(problem.total.energy(problem.begin), sigma) <= aim:
                    break
            change = 0.5 * change
        else:  # no step in this direction helps
            problem = Problem.of(data, replace(hypothesis, terms=terms), parameters)
            break
        terms = moved
        if still:
            break
    found, at_end = _within_range(problem, problem.linear, sigma, width)
    return replace(
        _cross_validated(problem, replace(hypothesis, terms=terms), found, width, at_end), partial=partial
    )


def with_other_file_parameters(data: Data, hypothesis: Hypothesis, start: Fit) -> Fit:
    """One Newton step from a fit of a hypothesis that takes other parameters from the robot file."""
    problem = Problem.of(data, replace(hypothesis, terms=start.hypothesis.terms), start.parameters)
    width = _width(data, hypothesis)
    found, at_end = _within_range(problem, problem.linear, start.sigma, width)
    made = _cross_validated(problem, replace(hypothesis, terms=start.hypothesis.terms), found, width, at_end)
    return replace(made, partial=start.partial)


def _width(data: Data, hypothesis: Hypothesis) -> float:
    """Relative width of the prior of the bodies."""
    own = data.width
    return min(own, hypothesis.accuracy or FILE) if BODIES in hypothesis.from_file else own


def _energy(data: Data, terms: Sequence[Term], parameters: Array) -> Array:
    """Squared residual of each joint in the fitted rows, shape (n,)."""
    residual = [data.target(run) - data.terms.contributed(terms, run) for run in range(data.fitted)]
    for run, own in enumerate(residual):
        for k, (active, columns) in enumerate(zip(data.active, data.active_columns[run])):
            own[:, k] -= columns @ parameters[active]
    return np.asarray(sum(np.sum(residual[run][rows] ** 2, axis=0) for run, rows in data.stretches()))


def _weighted(energy: Array, sigma: Array) -> float:
    return float(np.sum(energy / sigma**2))


def _within_range(problem: Problem, layout: Layout, sigma: Array, width: float) -> tuple[Array, Mask]:
    """The minimum with all parameters of terms within their ranges, and those held at a bound.

    A parameter that would leave its range is held at the bound and the others are refitted (active set).

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
        outside, bounds = _outside(problem.terms, found[first:])
        more = np.concatenate([np.zeros(first, dtype=bool), outside]) & own.free
        if not more.any():
            break
        held |= more
        begin[np.flatnonzero(more)] = bounds[more[first:]]
    return found, held


def _outside(terms: Sequence[Term], change: Array) -> tuple[Mask, Array]:
    """Which parameters of terms would leave their ranges, and the changes that take them to the bounds."""
    pairs = [(term, p) for term in terms for p in term.free]
    before = np.array([term.parameters[p.name] for term, p in pairs])
    after, bounds, at = before + change, before + change, 0
    for term in terms:
        free = [p.name for p in term.free]
        wanted = dict(zip(free, bounds[at : at + len(free)]))
        inside = term.moved(wanted).parameters
        bounds[at : at + len(free)] = [inside[name] for name in free]
        at += len(free)
    return bounds != after, bounds - before


def _cross_validated(problem: Problem, hypothesis: Hypothesis, x: Array, width: float, at_end: Mask) -> Fit:
    """A fit with the cross-validated errors of all blocks.

    The fit without a fold is one Newton step from the fit to all folds. Parameters of terms that no other
    fold determines are kept; what they cost is part of the prior odds. Parameters at a bound, `at_end`, stay
    there.
    """
    data, layout, total = problem.data, problem.layout, problem.total
    sigma = residual_rms(total, x, data.least)
    free, weight = layout.free, 1.0 / sigma**2
    hessian = objective(layout, total, sigma, width, x)[2][np.ix_(free, free)]
    kept = _kept_by_fold(problem, weight)
    moves = (~np.concatenate([np.zeros((len(kept), data.start.size), dtype=bool), kept], axis=1) & ~at_end)[
        :, free
    ]
    by_fold = {HELD_OUT: x}
    for freed, (f, normal) in zip(moves, problem.folds.items()):
        moving = np.flatnonzero(free)[freed]
        length = layout.size[moving]
        without_fold = x.copy()
        gram, right = normal.weighted(weight)
        slope = (gram @ x - right)[moving]
        matrix = (hessian[np.ix_(freed, freed)] - gram[np.ix_(moving, moving)]) * np.outer(length, length)
        matrix += RIDGE * max(np.trace(matrix) / max(len(matrix), 1), 1e-300) * np.eye(len(matrix))
        without_fold[moving] += length * np.linalg.solve(matrix, length * slope)
        by_fold[f] = without_fold
    errors = problem.errors(by_fold)
    deviations = _deviation(problem, x, sigma, width)
    moved = replace(hypothesis, terms=_updated(hypothesis.terms, x[data.start.size :]))
    cut_rows = data.cut(moved.terms)
    return Fit(
        moved,
        x[: data.start.size],
        deviations,
        sigma,
        errors,
        layout,
        hessian,
        cut_rows,
        data.about_numbers,
        dict(_impossible(data, moved.terms, x[: data.start.size], cut_rows)),
        _precisions(problem, hessian, weight, np.any(kept, axis=0)),
    )


def _kept_by_fold(problem: Problem, weight: Array) -> Mask:
    """Parameters of terms that the fit without a fold keeps, as only that fold determines them, (F, P)."""
    event = [term.effect.is_event for term in problem.terms for _ in term.free]
    first = problem.data.start.size
    parts = [np.diag(part.weighted(weight)[0])[first:] for part in problem.folds.values()]
    return of_one_fold(np.array(parts)) | np.array(event, dtype=bool)


def of_one_fold(information: Array) -> Mask:
    """Parameters that each fold determines better than all others together, shape (F, P).

    Args:
        information: on each parameter in each fold, shape (F, P).
    """
    return np.asarray(information > ONE_FOLD * np.maximum(information.sum(axis=0), np.finfo(float).tiny))


def _precisions(
    problem: Problem, hessian: Array, weight: Array, once: Mask
) -> dict[tuple[str, str], Precision]:
    """How precisely the rows determine the parameters of terms that a single fold determines.

    Args:
        problem: the normal equations.
        hessian: of the objective by all free parameters.
        weight: of each joint, shape (n,).
        once: whether a single fold determines a parameter, shape (P,).
    """
    free, first, total = problem.layout.free, problem.data.start.size, problem.total
    chosen = free & np.concatenate([np.zeros(first, dtype=bool), once])
    if not chosen.any():
        return {}
    size = 1.0 / np.sqrt(np.maximum(np.diag(hessian), np.finfo(float).tiny))
    inverse = np.linalg.pinv(hessian * np.outer(size, size), hermitian=True) * np.outer(size, size)
    information = np.zeros((weight.size, free.size))  # of each joint on each parameter
    for k, (own, gram) in enumerate(zip(total.active, total.gram)):
        information[k, own] = weight[k] * np.diag(gram)
    found = {}
    for term in problem.terms:
        here = np.arange(first, first + len(term.free))
        first += len(term.free)
        width = problem.spread(term)[chosen[here]]
        here = here[chosen[here]]
        if here.size:
            places = (np.cumsum(free) - 1)[here]
            matrix = np.linalg.pinv(inverse[np.ix_(places, places)] / np.outer(width, width), hermitian=True)
            joints = information[:, here] @ width**2
            total_of_joints = max(float(joints.sum()), np.finfo(float).tiny)
            found[term.key] = Precision(np.asarray(matrix), np.asarray(joints / total_of_joints))
    return found


def _impossible(
    data: Data, terms: Sequence[Term], parameters: Array, cut_rows: Array
) -> Iterator[tuple[tuple[str, str], str]]:
    """Terms with physically impossible parameters, with the reason.

    Args:
        data: the rows.
        terms: as fitted.
        parameters: of the standard model, shape (X,).
        cut_rows: number of rows in which terms saturate the torque, shape (B, n).
    """
    for term in terms:
        joint, needed = term.at.split(".")[0], 0.0
        if joint in data.joints:
            k = data.joints.index(joint)
            made = (own[k] @ parameters[data.active[k]] for own in data.active_columns)
            needed = max(float(np.abs(one).max()) for one in made)
        why = not_credible(term, data.robot, needed)
        if not why and term.effect.cuts_torque:
            k = data.joints.index(term.at)
            rows, cut = float(data.counts[:, k].sum()), float(cut_rows[:, k].sum())
            if cut > rows - cut:
                why = f"the drive would be at its limit {cut / rows:.0%} of the time, and follow no command"
        if not why and term.effect.is_beyond:
            active = [np.abs(data.columns(term, run)[:, :, 0]) for run in range(data.fitted)]
            least = BEYOND * max(float(one.max(initial=0.0)) for one in active)
            share = float(np.mean(np.concatenate([(one > least).any(axis=1) for one in active])))
            if share > 0.5:
                why = f"it would act {share:.0%} of the time, as a spring does"
        if why:
            yield term.key, why


def _deviation(problem: Problem, x: Array, sigma: Array, width: float) -> Array:
    """Standard deviations by the sandwich estimator, at least those for independent errors, shape (Y,).

    The sandwich of the blocks' scores and the prior is valid for any correlation of errors within a block,
    and nearly for one within a stretch, as it includes neighbouring blocks. But it carries no information on
    parameters that a single block determines, such as an event's. The number of independent errors follows
    from the band; the error of any model is added to the residual. The barrier that keeps friction positive
    is no information: an estimate of zero is as uncertain as any other.
    """
    weight = 1.0 / sigma**2
    free, anywhere = problem.layout.free, replace(problem.layout, positive=np.zeros(0, dtype=int))
    hessian = objective(anywhere, problem.total, sigma, width, x)[2][np.ix_(free, free)]
    hessian -= np.diag(problem.proximal[free])
    size = 1.0 / np.sqrt(np.maximum(np.diag(hessian), np.finfo(float).tiny))
    scaled = np.outer(size, size)
    scores = problem.scores(x, weight)[:, free] * size
    inverse = np.linalg.pinv(hessian * scaled, hermitian=True)
    influence = np.zeros((len(problem.data.blocks), len(size)))
    influence[problem.data.fitted_blocks] = (scores - scores.mean(axis=0)) @ inverse
    factor = len(scores) / max(len(scores) - BLOCKS, 1)
    rows = problem.total.weighted(weight)[0][np.ix_(free, free)]
    prior = (hessian - rows) * scaled
    variance = factor * variance_of_sum(influence, [b.run for b in problem.data.blocks]) + np.einsum(
        "xy,yz,zx->x", inverse, prior, inverse, optimize=True
    )
    least = problem.data.independent / (sigma**2 + problem.data.error**2)
    known = problem.total.weighted(least)[0][np.ix_(free, free)] * scaled + prior
    variance = np.maximum(variance, np.diag(np.linalg.pinv(known, hermitian=True)))
    found = np.zeros(x.size)
    found[free] = size * np.sqrt(np.maximum(variance, 0.0))
    if problem.layout.scale.any():  # in proportion to the file's bodies
        own = problem.data.layout.gaussian
        found[own] = np.where(found[own] > 0.0, np.hypot(found[own], FILE * x[own]), 0.0)
    return found


def variance_of_sum(influence: Array, runs: Sequence[int]) -> Array:
    """Variance of the sum of blocks that are correlated within a stretch, from one realisation, shape (Y,).

    The mean square of all sums of `BLOCKS` neighbours gives a covariance the weight of the Bartlett kernel,
    one minus the distance of two blocks in stretches (Newey and West, Econometrica 55 (1987)).

    Args:
        influence: of each block on the parameters, of mean zero, shape (B, Y).
        runs: recording of each block, shape (B,).
    """
    found = np.zeros(influence.shape[1])
    for run in set(runs):
        own = influence[np.array(runs) == run]
        nothing = np.zeros((BLOCKS, influence.shape[1]))
        total = np.cumsum(np.concatenate([nothing, own, nothing[1:]]), axis=0)
        found += np.sum((total[BLOCKS:] - total[:-BLOCKS]) ** 2, axis=0) / BLOCKS
    return found


def _updated(terms: Sequence[Term], change: Array) -> tuple[Term, ...]:
    """Terms with changed parameters; the change of non-linear parameters is limited."""
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


def contributions(data: Data, fit: Fit, run: int) -> Array:
    """Prediction of a fit for one recording, shape (K, n)."""
    found = data.designs[run] @ fit.parameters
    for term in fit.hypothesis.terms:
        found = found + data.columns(term, run)[:, :, 0]
    return np.asarray(found)


def residuals(data: Data, fit: Fit, run: int) -> Array:
    """Residual of a fit in one recording, zero where nothing is compared, shape (K, n)."""
    return np.where(data.counted(run), data.target(run) - contributions(data, fit, run), 0.0)
