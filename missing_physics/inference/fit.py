"""Fit of one hypothesis: weighted least squares, linearised about its present parameters until they converge.

The contribution of a term to the recorded torques is linear in its parameters, or linearised about their
present values (Gauss-Newton). The parameters of the standard model are fitted together with them, with the
priors of `missing_physics.standard`: physically consistent bodies and non-negative friction. Parameters that
a hypothesis takes from the robot file have a prior around the file's value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import BODIES, Hypothesis, Term, prior_of
from missing_physics.inference.columns import cut
from missing_physics.inference.data import HELD_OUT, Data
from missing_physics.standard.fit import FILE, minimise, objective, residual_rms
from missing_physics.standard.layout import Layout
from missing_physics.standard.normal import Normal, Places
from reference_model.effects.base import JointEffect

__all__ = ["FILE", "Fit", "contributions", "fitted", "refiled", "residuals"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Most rounds of Gauss-Newton, and those of a linear hypothesis: weights and parameters converge in three.
ROUNDS, LINEAR = 10, 3
#: The iteration ends where the predicted decrease of the squared residual, in units of its variance, is less.
AGREED = 1.0
#: A non-linear parameter moves by at most this part of itself in one round.
LARGEST = 0.7
#: and one that may have either sign by the same part of at least this part of its typical size.
EITHER_SIGN = 0.1
#: Most halvings of a step that makes the fit worse.
HALVINGS = 6
#: Ridge of the normal equations, whose columns have about unit length.
RIDGE = 1e-9


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
        taken: delays by which torques were shifted in the fit [s], shape (n,).
    """

    hypothesis: Hypothesis
    numbers: Array
    deviations: Array
    sigma: Array
    errors: Array
    layout: Layout
    hessian: Array
    cut: Array
    taken: Array

    def number(self, name: str) -> float:
        """One number of the standard model, or the timing of a joint."""
        return float(self.numbers[self.layout.names.index(name)])

    def deviation(self, name: str) -> float:
        """Standard deviation of one number, a term's as `EFFECT@PLACE.NUMBER`; 0 where it is held."""
        return float(self.deviations[self.layout.names.index(name)])


def fitted(data: Data, hypothesis: Hypothesis, start: Fit | None = None) -> Fit:
    """Fit a hypothesis to the recordings that are fitted, and predict every block without it.

    Args:
        data: the rows.
        hypothesis: its terms with starting values.
        start: a fit of a similar hypothesis.
    """
    terms = hypothesis.terms
    numbers = data.start if start is None else start.numbers
    sigma = data.standard.estimate.sigma if start is None else start.sigma
    linear = all(p.linear for term in terms for p in term.free)
    width, count = _width(data, hypothesis), data.start.size
    problem = _Problem.of(data, hypothesis, numbers)
    for _ in range(LINEAR if linear else ROUNDS):
        found = minimise(problem.layout, problem.total, sigma, width, problem.begin)
        sigma = residual_rms(problem.total, found)
        change = found[count:]
        whole = problem.total
        gained = _weighted(whole.energy(problem.begin) - whole.energy(found), sigma)
        still = gained < AGREED
        numbers = found[:count]
        if still and not terms:
            continue
        reached = whole.energy(problem.begin) if linear else problem.energy_at(numbers)
        for _ in range(1 if linear else HALVINGS):
            moved = _moved(terms, change)
            problem = _Problem.of(data, replace(hypothesis, terms=moved), numbers)
            if linear or _weighted(problem.total.energy(problem.begin), sigma) <= _weighted(reached, sigma):
                break
            change = 0.5 * change
        else:  # no step of this direction helps
            problem = _Problem.of(data, replace(hypothesis, terms=terms), numbers)
            break
        terms = moved
        if still:
            break
    found = minimise(problem.linear, problem.total, sigma, width, problem.begin)
    return _judged(problem, replace(hypothesis, terms=terms), found, width)


def refiled(data: Data, hypothesis: Hypothesis, start: Fit) -> Fit:
    """A fit that differs from another only in the parameters it takes from the file: one step from there."""
    problem = _Problem.of(data, replace(hypothesis, terms=start.hypothesis.terms), start.numbers)
    width = _width(data, hypothesis)
    found = minimise(problem.linear, problem.total, start.sigma, width, problem.begin)
    return _judged(problem, replace(hypothesis, terms=start.hypothesis.terms), found, width)


def _width(data: Data, hypothesis: Hypothesis) -> float:
    """Relative width of the bodies' prior."""
    own = data.standard.estimate.width
    return min(own, FILE) if BODIES in hypothesis.filed else own


def _weighted(energy: Array, sigma: Array) -> float:
    return float(np.sum(energy / sigma**2))


def _judged(problem: _Problem, hypothesis: Hypothesis, x: Array, width: float) -> Fit:
    """Errors of all blocks; those of each fold by one Newton step from the whole fit to that without it.

    Events keep their parameters, since no other fold determines them; their prior odds account for that.
    """
    data, layout, whole = problem.data, problem.layout, problem.total
    sigma = residual_rms(whole, x)
    free, weight = layout.free, 1.0 / sigma**2
    hessian = objective(layout, whole, sigma, width, x)[2][np.ix_(free, free)]
    once = np.repeat([t.effect.is_event for t in hypothesis.terms], [len(t.free) for t in hypothesis.terms])
    again = np.concatenate([np.ones(data.start.size, dtype=bool), ~once.astype(bool)])[free]
    open_ = np.flatnonzero(free)[again]
    among, length = np.ix_(open_, open_), layout.size[open_]
    apart = {HELD_OUT: x}
    for f, part in problem.folds.items():
        away = x.copy()
        gram, right = part.weighted(weight)
        slope = (gram @ x - right)[open_]
        matrix = (hessian[np.ix_(again, again)] - gram[among]) * np.outer(length, length)
        matrix += RIDGE * max(np.trace(matrix) / max(len(matrix), 1), 1e-300) * np.eye(len(matrix))
        away[open_] += length * np.linalg.solve(matrix, length * slope)
        apart[f] = away
    errors = problem.errors(apart)
    deviations = _deviation(problem, x, hessian, weight)
    moved = replace(hypothesis, terms=_moved(hypothesis.terms, x[data.start.size :]))
    return Fit(
        moved,
        x[: data.start.size],
        deviations,
        sigma,
        errors,
        layout,
        hessian,
        _cut(data, moved.terms),
        data.delays,
    )


def _cut(data: Data, terms: Sequence[Term]) -> Array:
    """Rows of each block and joint in which terms cut the recorded torque, shape (B, n)."""
    found = np.zeros_like(data.counts)
    for term in terms:
        if isinstance(term.effect, JointEffect) and term.effect.cuts_torque:
            rows = [np.where(run.rows.counted, cut(term, run, i), 0.0) for i, run in enumerate(data.runs)]
            found += [rows[block.run][block.rows].sum(axis=0) for block in data.blocks]
    return found


def _deviation(problem: _Problem, x: Array, hessian: Array, weight: Array) -> Array:
    """Standard deviations by the scatter of the blocks' scores and of the prior (sandwich), shape (Y,)."""
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
    found = np.zeros(x.size)
    found[free] = size * np.sqrt(np.maximum(variance, 0.0))
    if problem.layout.scale.any():  # in proportion to the file's bodies
        own = problem.data.layout.own
        found[own] = np.where(found[own] > 0.0, np.hypot(found[own], FILE * x[own]), 0.0)
    return found


@dataclass(frozen=True)
class _Joint:
    """One joint's rows of a recording; zero where nothing is compared.

    Attributes:
        acts: parameters on which its torque depends, the terms' last, shape (u,).
        columns: derivatives by them, shape (K, u).
        target: torque less that of the terms, shape (K,).
        has_terms: whether any of these acts there.
    """

    acts: Places
    columns: Array
    target: Array
    has_terms: bool


@dataclass(frozen=True)
class _Problem:
    """Normal equations of the fitted rows, linearised about the present values of the terms.

    Attributes:
        data: the rows.
        layout: of the standard model's parameters and the changes of the terms' parameters.
        begin: where a fit begins, shape (Y,).
        rows: of each fitted recording, joint by joint.
        total: over all fitted rows.
    """

    data: Data
    terms: tuple[Term, ...]
    layout: Layout
    begin: Array
    rows: Mapping[int, Sequence[_Joint]]
    total: Normal

    @classmethod
    def of(cls, data: Data, hypothesis: Hypothesis, numbers: Array) -> _Problem:
        rows = _rows(data, hypothesis.terms, range(data.fitted))
        total = _normal(data, rows, hypothesis.terms)
        layout, begin = _extended(data, hypothesis, numbers, _felt(total, data))
        return cls(data, hypothesis.terms, layout, begin, rows, total)

    @cached_property
    def folds(self) -> dict[int, Normal]:
        """Normal equations of each fold that is fitted."""
        return {fold: _normal(self.data, self.rows, self.terms, fold) for fold in self.data.folds}

    @property
    def linear(self) -> Layout:
        """The layout in which numbers stay of which the rows are not linear, so that errors are exact."""
        count, free = self.data.start.size, self.layout.free.copy()
        free[count:] = [p.linear for term in self.terms for p in term.free]
        return replace(self.layout, free=free)

    def energy_at(self, numbers: Array) -> Array:
        """Squared residual of each joint with these standard model parameters and the present terms."""
        found = np.zeros_like(self.begin)
        found[: numbers.size] = numbers
        return self.total.energy(found)

    def errors(self, apart: Mapping[int, Array]) -> Array:
        """Squared error of each block and joint, by the parameters of its fold, shape (B, n)."""
        found = np.empty_like(self.data.counts)
        held = range(self.data.fitted, len(self.data.runs))
        rows = {**self.rows, **_rows(self.data, self.terms, held)}
        for number, block in enumerate(self.data.blocks):
            x = apart[block.fold]
            for k, joint in enumerate(rows[block.run]):
                left = joint.target[block.rows] - joint.columns[block.rows] @ x[joint.acts]
                found[number, k] = left @ left
        return found

    def scores(self, x: Array, weight: Array) -> Array:
        """Gradient of the log-likelihood of each fitted block, shape (B, Y)."""
        blocks = [block for block in self.data.blocks if block.fold != HELD_OUT]
        found = np.zeros((len(blocks), x.size))
        for own, block in zip(found, blocks):
            for k, joint in enumerate(self.rows[block.run]):
                columns = joint.columns[block.rows]
                left = joint.target[block.rows] - columns @ x[joint.acts]
                own[joint.acts] += weight[k] * (left @ columns)
        return found


def _rows(data: Data, terms: Sequence[Term], runs: Sequence[int]) -> dict[int, list[_Joint]]:
    """Rows of some recordings, joint by joint, whose parameters are the same in all of them."""
    for run in runs:
        data.prepare(terms, run)
    made = {run: [data.acting(term, run) for term in terms] for run in runs}
    ends = data.start.size + np.cumsum([0, *(len(term.free) for term in terms)])
    here: list[list[int]] = [[] for _ in data.joints]
    for number in range(len(terms)):
        for k in {int(k) for each in made.values() for k in each[number][0]}:
            here[k].append(number)
    found: dict[int, list[_Joint]] = {run: [] for run in runs}
    for k, numbers in enumerate(here):
        acts = np.concatenate([data.acts[k], *(np.arange(ends[t], ends[t + 1]) for t in numbers)])
        for run in runs:
            target, columns = data.target(run)[:, k], [data.own[run][k]]
            for t in numbers:
                joints, values = made[run][t]
                own = values[:, joints == k].sum(axis=1)  # none where it does not act in this recording
                target = target - own[:, 0]
                columns.append(own[:, 1:])
            found[run].append(_Joint(acts, np.concatenate(columns, axis=1), target, bool(numbers)))
    return found


def _normal(
    data: Data, rows: Mapping[int, Sequence[_Joint]], terms: Sequence[Term], fold: int | None = None
) -> Normal:
    """Normal equations of one fold, or of all fitted rows; those of a joint without terms are known."""
    alone = data.normal(fold)
    joints = next(iter(rows.values()))
    gram, right, square = list(alone.gram), list(alone.right), alone.square.copy()
    for k, joint in enumerate(joints):
        if not joint.has_terms:
            continue
        own = [(rows[run][k], part) for run, part in data.stretches(fold)]
        columns = np.concatenate([one.columns[part] for one, part in own])
        target = np.concatenate([one.target[part] for one, part in own])
        gram[k], right[k], square[k] = columns.T @ columns, columns.T @ target, target @ target
    size = data.start.size + sum(len(term.free) for term in terms)
    return Normal(tuple(joint.acts for joint in joints), tuple(gram), tuple(right), square, alone.count, size)


def _felt(total: Normal, data: Data) -> Array:
    """Ratio of the rms of every added column to that of the torque, at the joint where it is largest."""
    first = data.start.size
    found = np.zeros(total.size - first)
    rows, torque = np.maximum(total.count, 1.0), np.maximum(data.torque, 1e-300)
    for k, (own, gram) in enumerate(zip(total.acts, total.gram)):
        added = own >= first
        ratio = np.sqrt(np.diagonal(gram)[added] / rows[k]) / torque[k]
        found[own[added] - first] = np.maximum(found[own[added] - first], ratio)
    return found


def _extended(data: Data, hypothesis: Hypothesis, numbers: Array, felt: Array) -> tuple[Layout, Array]:
    """Layout of the standard model's parameters and the terms' changes, and where a fit begins."""
    base, each = data.layout, [(term, p) for term in hypothesis.terms for p in term.free]
    start, free = np.concatenate([numbers, np.zeros(len(each))]), base.free.copy()
    middle, spread = base.centre.copy(), base.width.copy()
    for name in hypothesis.filed - {BODIES}:
        place = base.names.index(name)
        value = data.filed[place]
        if value == 0.0:
            free[place], start[place] = False, 0.0
        else:
            middle[place], spread[place] = value, FILE * abs(value)
    for name, value in hypothesis.held:
        place = base.names.index(name)
        free[place], start[place] = False, value
    positive = np.array([i for i in base.positive if free[i]], dtype=int)
    start[positive] = np.maximum(start[positive], 1e-9 * base.size[positive])
    size, centre, width = (np.empty(len(each)) for _ in range(3))
    for i, (term, p) in enumerate(each):
        value = term.parameters[p.name]
        size[i] = 1.0 / felt[i] if felt[i] > 0.0 else max(abs(value), p.typical)
        if not p.linear:
            size[i] = min(size[i], 0.5 * max(abs(value), 1e-3 * p.typical))
        known = prior_of(term, p)
        expected = (p.absent or 0.0) if p.linear else value
        if term.is_given:  # about the robot file's value, wrong by as much as itself
            expected = term.filed(p.name)
            known = (expected, abs(expected)) if expected != 0.0 else None
        centre[i], width[i] = (expected - value, size[i]) if known is None else (known[0] - value, known[1])
        size[i] = min(size[i], width[i])
    count = len(base.names)
    layout = Layout(
        names=(*base.names, *(f"{term.effect.id}@{term.at}.{p.name}" for term, p in each)),
        start=np.concatenate([base.start, np.zeros(len(each))]),
        free=np.concatenate([free, np.ones(len(each), dtype=bool)]),
        bodies=base.bodies,
        own=np.concatenate([[i for i in base.own if free[i]], count + np.arange(len(each))]).astype(int),
        positive=positive,
        size=np.concatenate([base.size, size]),
        centre=np.concatenate([middle, centre]),
        width=np.concatenate([spread, width]),
        scale=np.concatenate([base.scale, np.zeros(len(each))]),
    )
    return layout, start


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
    return np.where(
        data.runs[number].rows.counted, data.target(number) - contributions(data, fit, number), 0.0
    )
