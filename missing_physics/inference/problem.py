"""The rows of all recordings in blocks, and the fit of a hypothesis to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses.priors import prior_of
from missing_physics.hypotheses.term import Term
from missing_physics.inference.columns import columns_of
from missing_physics.inference.runs import Run
from missing_physics.standard import StandardModel
from missing_physics.standard.fit import _minimise, _objective, _Problem, design_of
from missing_physics.standard.layout import Layout

__all__ = ["Fit", "Hypothesis", "Problem"]

Array = NDArray[np.float64]

#: Parts of the fitted recordings of which each is left out once, and blocks of each part.
FOLDS, BLOCKS = 5, 6
#: Rounds of the fit, and the change of a number over its standard deviation that ends them.
ROUNDS, AGREED = 8, 0.05


@dataclass(frozen=True)
class Hypothesis:
    """The standard model with terms.

    Attributes:
        terms: effects beyond the standard model.
        held: numbers of the standard model that are not estimated, and their values.
    """

    terms: tuple[Term, ...] = ()
    held: tuple[tuple[str, float], ...] = ()

    def key(self) -> tuple[object, ...]:
        """What distinguishes it, whatever the values."""
        return tuple(sorted(t.key for t in self.terms)), tuple(sorted(self.held))


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    Attributes:
        hypothesis: with the numbers found.
        values: of the standard model's numbers, shape (X,).
        deviation: of the terms' numbers, term by term.
        sigma: rms of what is left at each joint, shape (n,).
        left: squared error of each joint in each block, left out of the fit, shape (B, n).
        unseen: the same of blocks of held-out recordings, shape (V, n).
        hessian: of everything that is free.
    """

    hypothesis: Hypothesis
    values: Array
    deviation: tuple[Array, ...]
    sigma: Array
    left: Array
    unseen: Array
    layout: Layout
    solution: Array
    hessian: Array
    folds: tuple[Array, ...]


@dataclass
class Problem:
    """Everything that fits need; blocks of rows of M runs.

    Attributes:
        standard: the standard model.
        runs, unseen: recordings that are fitted, and those that are held out.
    """

    standard: StandardModel
    runs: tuple[Run, ...]
    unseen: tuple[Run, ...]
    _columns: dict[object, list[Array]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.every = (*self.runs, *self.unseen)
        self.designs = [design_of(r.rows) for r in self.every]
        self.blocks: list[tuple[int, slice, int]] = []
        parts = 1 if len(self.runs) >= FOLDS else FOLDS
        for i, run in enumerate(self.every):
            cuts = np.linspace(0, run.rows.time.size, parts * BLOCKS + 1).astype(int)
            for b, (a, c) in enumerate(pairwise(cuts)):
                fold = (i * parts + b // BLOCKS) if i < len(self.runs) else -1
                self.blocks.append((i, slice(a, c), fold))
        self.base = []
        for i, s, _ in self.blocks:
            d = np.where(self.every[i].rows.counted[s][:, :, None], self.designs[i][s], 0.0)
            self.base.append(d.transpose(1, 2, 0) @ d.transpose(1, 0, 2))
        self.counts = np.array([self.every[i].rows.counted[s].sum(axis=0) for i, s, _ in self.blocks], float)
        self.seen = np.array([f >= 0 for _, _, f in self.blocks])
        self.fold = np.array([f for _, _, f in self.blocks])

    def columns(self, term: Term) -> list[Array]:
        """Of each run."""
        key = (term.key, term.values)
        if key not in self._columns:
            if len(self._columns) > 400:
                self._columns.clear()
            self._columns[key] = [columns_of(term, run) for run in self.every]
        return self._columns[key]

    def fitted(self, hypothesis: Hypothesis, start: Array | None = None, sigma: Array | None = None) -> Fit:
        """Fit by Gauss-Newton; the terms' numbers are moved."""
        terms = list(hypothesis.terms)
        x = self.standard.estimate.values if start is None else start
        sigma = self.standard.estimate.sigma if sigma is None else sigma
        rounds = ROUNDS if any(not p.linear for t in terms for p in t.free) else 3
        for _ in range(rounds if terms else 3):
            layout, begin, sums = self._sums(terms, hypothesis.held, x)
            whole = sums.total(self.seen)
            found = _minimise(layout, whole, sigma, self.standard.estimate.width, begin)
            sigma = sums.rms(found, self.seen)
            count = len(self.standard.estimate.layout.names)
            x, change = found[:count], found[count:]
            done = np.all(np.abs(change) <= 1e-3 * layout.size[count:])
            if not terms or done:
                break
            terms = _moved(terms, change)
        layout, begin, sums = self._sums(terms, hypothesis.held, x)
        whole = sums.total(self.seen)
        found = _minimise(layout, whole, sigma, self.standard.estimate.width, begin)
        sigma = sums.rms(found, self.seen)
        count = len(self.standard.estimate.layout.names)
        terms = _moved(terms, found[count:])
        return self._judged(replace(hypothesis, terms=tuple(terms)), layout, sums, found, sigma)

    def _judged(self, hypothesis: Hypothesis, layout: Layout, sums: Sums, x: Array, sigma: Array) -> Fit:
        free, width = layout.free, self.standard.estimate.width
        whole = sums.total(self.seen)
        hessian = _objective(layout, whole, sigma, width, x)[2][np.ix_(free, free)]
        weight = 1.0 / sigma**2
        size = layout.size[free]
        left = np.zeros((int(self.seen.sum()), sigma.size))
        solutions = []
        for f in range(int(self.fold.max()) + 1):
            part = sums.total(self.fold == f)
            own = np.einsum("j,jxy->xy", weight, part.gram)[np.ix_(free, free)]
            slope = (weight @ (part.gram @ x - part.right))[free]
            matrix = (hessian - own) * np.outer(size, size)
            matrix += 1e-9 * np.eye(len(matrix)) * max(np.trace(matrix) / len(matrix), 1e-300)
            away = x.copy()
            away[free] += size * np.linalg.solve(matrix, size * slope)
            solutions.append(away)
            mask = self.fold == f
            left[mask[self.seen]] = sums.energies(away, mask)
        unseen = sums.energies(x, ~self.seen)
        count = len(self.standard.estimate.layout.names)
        scores = np.array(
            [(weight @ (sums.right[b] - sums.gram[b] @ x))[free] for b in np.flatnonzero(self.seen)]
        ) * size
        scores -= scores.mean(axis=0)
        inverse = np.linalg.pinv(hessian * np.outer(size, size), hermitian=True)
        covariance = inverse @ (scores.T @ scores) @ inverse
        deviation = np.zeros(x.size)
        deviation[free] = size * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        parts, at = [], count
        for t in hypothesis.terms:
            parts.append(deviation[at : at + len(t.free)])
            at += len(t.free)
        return Fit(
            hypothesis, x[:count], tuple(parts), sigma, left, unseen, layout, x, hessian, tuple(solutions)
        )

    def _sums(self, terms: Sequence[Term], held: Sequence[tuple[str, float]], x: Array) -> tuple[Layout, Array, Sums]:
        base = self.standard.estimate.layout
        layout, begin = _extended(base, terms, held, x)
        columns = [self.columns(t) for t in terms]
        value = [sum((c[i][:, :, 0] for c in columns), np.zeros(())) for i in range(len(self.every))]
        extra = [
            np.concatenate([c[i][:, :, 1:] for c in columns], axis=2) if columns else None
            for i in range(len(self.every))
        ]
        sums = Sums.of(self, value, extra)
        count = len(base.names)
        if terms:
            torque = np.sqrt(np.mean(np.concatenate([r.rows.measured for r in self.runs]) ** 2, axis=0))
            whole = sums.total(self.seen)
            rows = self.counts[self.seen].sum(axis=0)
            felt = np.einsum("jxx->jx", whole.gram)[:, count:] / np.maximum(rows, 1.0)[:, None]
            j = np.argmax(felt, axis=0)
            scale = np.maximum(torque[j], 1e-300) / np.sqrt(np.maximum(felt.max(axis=0), 1e-300))
            sizes, widths, centre, at = layout.size.copy(), layout.width.copy(), layout.centre.copy(), 0
            for t in terms:
                for p in t.free:
                    own = scale[at]
                    if not p.linear:
                        own = min(own, 0.5 * max(abs(t.parameters[p.name]), 1e-3 * p.typical))
                    if felt.max(axis=0)[at] <= 0.0:
                        own = max(abs(t.parameters[p.name]), p.typical) * 1e-3
                    own = max(own, 1e-12)
                    sizes[count + at] = widths[count + at] = own
                    known = prior_of(t, p)
                    if known is not None:
                        centre[count + at] = known[0] - t.parameters[p.name]
                        widths[count + at] = known[1]
                        sizes[count + at] = min(own, known[1])
                    at += 1
            layout = replace(layout, size=sizes, centre=centre, width=widths)
        return layout, begin, sums


@dataclass(frozen=True)
class Sums:
    """Normal equations of every block, joint by joint."""

    gram: list[Array]
    right: list[Array]
    square: Array
    count: Array

    @classmethod
    def of(cls, problem: Problem, value: Sequence[Array], extra: Sequence[Array | None]) -> Sums:
        gram, right, square = [], [], []
        for base, (i, s, _) in zip(problem.base, problem.blocks):
            run = problem.every[i]
            counted = run.rows.counted[s]
            target = run.rows.torque[s] - (value[i][s] if np.ndim(value[i]) else 0.0)
            target = np.where(counted, target, 0.0)
            design = problem.designs[i][s].transpose(1, 2, 0)  # (n, X, K)
            right_base = np.einsum("jxt,tj->jx", design, target)
            own = extra[i]
            if own is None:
                gram.append(base)
                right.append(right_base)
            else:
                c = np.where(counted[:, :, None], own[s], 0.0).transpose(1, 0, 2)  # (n, K, C)
                cross = design @ c
                inner = c.transpose(0, 2, 1) @ c
                gram.append(np.block([[base, cross], [cross.transpose(0, 2, 1), inner]]))
                right.append(np.hstack([right_base, np.einsum("jtc,tj->jc", c, target)]))
            square.append(np.sum(target**2, axis=0))
        return cls(gram, right, np.array(square), problem.counts)

    def total(self, mask: NDArray[np.bool_]) -> _Problem:
        index = np.flatnonzero(mask)
        return _Problem(
            sum(self.gram[b] for b in index),
            sum(self.right[b] for b in index),
            self.square[index].sum(axis=0),
            self.count[index].sum(axis=0),
        )

    def energies(self, x: Array, mask: NDArray[np.bool_]) -> Array:
        """Squared error of each joint in each of these blocks."""
        index = np.flatnonzero(mask)
        n = self.square.shape[1]
        found = np.zeros((index.size, n))
        for i, b in enumerate(index):
            found[i] = self.square[b] - 2.0 * self.right[b] @ x + np.einsum("jxy,x,y->j", self.gram[b], x, x)
        return np.maximum(found, 0.0)

    def energy(self, x: Array, mask: NDArray[np.bool_]) -> Array:
        return self.energies(x, mask).sum(axis=0)

    def rms(self, x: Array, mask: NDArray[np.bool_]) -> Array:
        count = self.count[mask].sum(axis=0)
        square = self.square[mask].sum(axis=0)
        energy = self.energy(x, mask)
        floor = 1e-12 * square / np.maximum(count, 1.0) + 1e-300
        return np.where(count > 0, np.sqrt(np.maximum(energy / np.maximum(count, 1.0), floor)), 1.0)


def _moved(terms: Sequence[Term], change: Array) -> list[Term]:
    found, at = [], 0
    for t in terms:
        own = change[at : at + len(t.free)]
        at += len(t.free)
        values = {}
        for p, d in zip(t.free, own):
            before = t.parameters[p.name]
            if not p.linear:  # no step larger than the number itself
                limit = max(0.7 * abs(before), 1e-3 * p.typical)
                d = float(np.clip(d, -limit, limit))
            values[p.name] = before + float(d)
        found.append(t.moved(values))
    return found


def _extended(base: Layout, terms: Sequence[Term], held: Sequence[tuple[str, float]], x: Array) -> tuple[Layout, Array]:
    names = [f"{t.effect.id}@{t.at}.{p.name}" for t in terms for p in t.free]
    start, free = np.concatenate([x, np.zeros(len(names))]), base.free.copy()
    for name, value in held:
        place = base.names.index(name)
        free[place], start[place] = False, value
    own = np.array([i for i in base.own if free[i]], dtype=int)
    positive = np.array([i for i in base.positive if free[i]], dtype=int)
    start[positive] = np.maximum(start[positive], 1e-9 * base.size[positive])
    count = len(base.names)
    layout = Layout(
        (*base.names, *names),
        np.concatenate([base.start, np.zeros(len(names))]),
        np.concatenate([free, np.ones(len(names), dtype=bool)]),
        base.bodies,
        np.concatenate([own, np.arange(count, count + len(names))]),
        positive,
        np.concatenate([base.size, np.ones(len(names))]),
        np.concatenate([base.centre, np.zeros(len(names))]),
        np.concatenate([base.width, np.ones(len(names))]),
    )
    return layout, start
