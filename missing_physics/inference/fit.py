"""One hypothesis fitted: weighted least squares about its present numbers, repeated until they stay.

What a term adds to the recorded torques is linear in its numbers, or made so about their present values
(Gauss-Newton). Numbers of the standard model are fitted along with them, with the priors of
`missing_physics.standard`: real bodies, and friction that is not negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Hypothesis, Term, prior_of
from missing_physics.inference.data import HELD_OUT, Data
from missing_physics.standard.fit import Normal, minimise, objective, residual_rms
from missing_physics.standard.layout import Layout

__all__ = ["Fit", "contributions", "fitted", "residuals"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Rounds of Gauss-Newton at most, and of a hypothesis that is linear: weights and numbers agree after three.
ROUNDS, LINEAR = 10, 3
#: A round that moves every number by less than this part of its scale is the last.
AGREED = 1e-3
#: A non-linear number moves by at most this part of itself in one round.
LARGEST = 0.7
#: Halvings of a step that makes the fit worse.
HALVINGS = 4
#: Ridge of the normal equations, whose columns have about unit length.
RIDGE = 1e-9


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    Attributes:
        hypothesis: with the numbers found.
        numbers: of the standard model, the timing last, shape (X,).
        deviations: standard deviation of every term's estimated numbers, from the scatter of blocks.
        sigma: rms of the residual of each joint in the fitted rows, shape (n,).
        errors: squared error of each block and joint, predicted without that block, shape (B, n).
        layout: of all numbers, the terms' behind the standard model's.
        hessian: second derivative of the objective by all free numbers.
    """

    hypothesis: Hypothesis
    numbers: Array
    deviations: tuple[Array, ...]
    sigma: Array
    errors: Array
    layout: Layout
    hessian: Array

    def number(self, name: str) -> float:
        """One number of the standard model, or the timing."""
        return float(self.numbers[self.layout.names.index(name)])


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
    width, count = data.standard.estimate.width, data.start.size
    problem = _Problem.of(data, terms, hypothesis.held, numbers)
    for _ in range(LINEAR if linear else ROUNDS):
        whole = problem.total(data.seen)
        found = minimise(problem.layout, whole, sigma, width, problem.begin)
        sigma = residual_rms(whole, found)
        change = found[count:]
        still = bool(np.all(np.abs(change) <= AGREED * problem.layout.size[count:]))
        numbers = found[:count]
        if still and not terms:
            continue
        reached = whole.energy(problem.begin) if linear else whole.energy(_at(problem, numbers))
        for _ in range(1 if linear else HALVINGS):
            moved = _moved(terms, change)
            problem = _Problem.of(data, moved, hypothesis.held, numbers)
            if linear or _weighted(problem.total(data.seen).energy(problem.begin), sigma) <= _weighted(
                reached, sigma
            ):
                break
            change = 0.5 * change
        terms = moved
        if still:
            break
    whole = problem.total(data.seen)
    found = minimise(problem.layout, whole, sigma, width, problem.begin)
    return _judged(data, replace(hypothesis, terms=_moved(terms, found[count:])), problem, found)


def _at(problem: _Problem, numbers: Array) -> Array:
    """These numbers of the standard model, terms as they are."""
    found = np.zeros_like(problem.begin)
    found[: numbers.size] = numbers
    return found


def _weighted(energy: Array, sigma: Array) -> float:
    return float(np.sum(energy / sigma**2))


def _judged(data: Data, hypothesis: Hypothesis, problem: _Problem, x: Array) -> Fit:
    """Errors of all blocks, those of each fold by one Newton step from the whole fit to that without it.

    What happens once keeps its numbers, since no other fold tells them; the prior makes it pay for that.
    """
    layout, width = problem.layout, data.standard.estimate.width
    whole = problem.total(data.seen)
    sigma = residual_rms(whole, x)
    free, weight = layout.free, 1.0 / sigma**2
    hessian = objective(layout, whole, sigma, width, x)[2][np.ix_(free, free)]
    errors = np.zeros((len(data.blocks), sigma.size))
    once = np.repeat([t.run is not None for t in hypothesis.terms], [len(t.free) for t in hypothesis.terms])
    again = np.concatenate([np.ones(data.start.size, dtype=bool), ~once.astype(bool)])[free]
    fold, open_ = data.fold, np.flatnonzero(free)[again]
    among, length = np.ix_(open_, open_), layout.size[open_]
    for f in np.unique(fold):
        away = x.copy()
        if f != HELD_OUT:
            part = problem.total(fold == f)
            own = np.einsum("j,jxy->xy", weight, part.gram)[among]
            slope = (weight @ (part.gram @ x - part.right))[open_]
            matrix = (hessian[np.ix_(again, again)] - own) * np.outer(length, length)
            matrix += RIDGE * max(np.trace(matrix) / len(matrix), 1e-300) * np.eye(len(matrix))
            away[open_] += length * np.linalg.solve(matrix, length * slope)
        for b in np.flatnonzero(fold == f):
            errors[b] = problem.blocks[b].energy(away)
    count = data.start.size
    deviation = _deviation(problem, x, data.seen, hessian, weight)[count:]
    ends = np.cumsum([len(term.free) for term in hypothesis.terms])[:-1]
    deviations = tuple(np.split(deviation, ends)) if hypothesis.terms else ()
    return Fit(hypothesis, x[:count], deviations, sigma, errors, layout, hessian)


def _deviation(problem: _Problem, x: Array, seen: Mask, hessian: Array, weight: Array) -> Array:
    """Standard deviations by the scatter of the blocks' scores (sandwich), shape (X,)."""
    free, size = problem.layout.free, problem.layout.size[problem.layout.free]
    blocks = [problem.blocks[b] for b in np.flatnonzero(seen)]
    scores = np.array([(weight @ (b.right - b.gram @ x))[free] * size for b in blocks])
    scores -= scores.mean(axis=0)
    inverse = np.linalg.pinv(hessian * np.outer(size, size), hermitian=True)
    factor = len(blocks) / max(len(blocks) - 1, 1)
    found = np.zeros(x.size)
    found[free] = size * np.sqrt(np.maximum(factor * np.sum((scores @ inverse) ** 2, axis=0), 0.0))
    return found


@dataclass(frozen=True)
class _Problem:
    """Normal equations of every block about the present values of the terms.

    Attributes:
        layout: of the standard model's numbers and the terms' changes.
        begin: where a fit begins, shape (X,).
        blocks: one for each block of the data.
    """

    layout: Layout
    begin: Array
    blocks: tuple[Normal, ...]

    @classmethod
    def of(
        cls, data: Data, terms: Sequence[Term], held: Sequence[tuple[str, float]], numbers: Array
    ) -> _Problem:
        columns = [[data.columns(term, i) for term in terms] for i in range(len(data.runs))]
        blocks = []
        for block in data.blocks:
            run, own = data.runs[block.run].rows, columns[block.run]
            counted = run.counted[block.rows]
            target = run.torque[block.rows] - sum(c[block.rows, :, 0] for c in own)
            target = np.where(counted, target, 0.0)
            design = data.designs[block.run][block.rows].transpose(1, 2, 0)
            gram, right = block.gram, np.einsum("jxt,tj->jx", design, target)
            if own:
                added = np.concatenate([c[block.rows, :, 1:] for c in own], axis=2)
                added = np.where(counted[:, :, None], added, 0.0).transpose(1, 0, 2)
                cross, inner = design @ added, added.transpose(0, 2, 1) @ added
                gram = np.block([[gram, cross], [cross.transpose(0, 2, 1), inner]])
                right = np.hstack([right, np.einsum("jtc,tj->jc", added, target)])
            blocks.append(Normal(gram, right, np.sum(target**2, axis=0), block.count))
        layout, begin = _extended(data, terms, held, numbers, _felt(blocks, data))
        return cls(layout, begin, tuple(blocks))

    def total(self, which: Mask) -> Normal:
        """Of some blocks together."""
        chosen = [self.blocks[b] for b in np.flatnonzero(which)]
        return sum(chosen[1:], chosen[0])


def _felt(blocks: Sequence[Normal], data: Data) -> Array:
    """rms of every added column over that of the torque, at the joint where this is largest."""
    chosen = [block for block, seen in zip(blocks, data.seen) if seen]
    squares = np.sum([np.einsum("jxx->jx", b.gram)[:, data.start.size :] for b in chosen], axis=0)
    rows = np.maximum(np.sum([b.count for b in chosen], axis=0), 1.0)
    return np.asarray(
        (np.sqrt(squares / rows[:, None]) / np.maximum(data.torque, 1e-300)[:, None]).max(axis=0)
    )


def _extended(
    data: Data, terms: Sequence[Term], held: Sequence[tuple[str, float]], numbers: Array, felt: Array
) -> tuple[Layout, Array]:
    """Layout with the terms' changes behind the standard model's numbers, and where a fit begins."""
    base, each = data.layout, [(term, p) for term in terms for p in term.free]
    start, free = np.concatenate([numbers, np.zeros(len(each))]), base.free.copy()
    for name, value in held:
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
        middle = (p.absent or 0.0) if p.linear else value
        centre[i], width[i] = (middle - value, size[i]) if known is None else (known[0] - value, known[1])
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
        centre=np.concatenate([base.centre, centre]),
        width=np.concatenate([base.width, width]),
    )
    return layout, start


def _moved(terms: Sequence[Term], change: Array) -> tuple[Term, ...]:
    """Terms with their numbers changed, non-linear ones by no more than a part of themselves."""
    found, at = [], 0
    for term in terms:
        values = {}
        for p, step in zip(term.free, change[at : at + len(term.free)]):
            before = term.parameters[p.name]
            limit = np.inf if p.linear else LARGEST * max(abs(before), 1e-3 * p.typical)
            values[p.name] = before + float(np.clip(step, -limit, limit))
        at += len(term.free)
        found.append(term.moved(values))
    return tuple(found)


def contributions(data: Data, fit: Fit, number: int) -> Array:
    """Torques that a fit explains in one recording, shape (K, n)."""
    found = data.designs[number] @ fit.numbers
    for term in fit.hypothesis.terms:
        found = found + data.columns(term, number)[:, :, 0]
    return np.asarray(found)


def residuals(data: Data, fit: Fit, number: int) -> Array:
    """What a fit leaves in one recording, zero where nothing is compared, shape (K, n)."""
    rows = data.runs[number].rows
    return np.where(rows.counted, np.nan_to_num(rows.torque - contributions(data, fit, number)), 0.0)
