"""Normal equations of one hypothesis, linearised about the present values of its terms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import BODIES, Hypothesis, Term, prior_of
from missing_physics.inference.data import HELD_OUT, Data
from missing_physics.standard.fit import FILE
from missing_physics.standard.layout import Layout
from missing_physics.standard.normal import Normal, Places
from reference_model.effects.base import BodyEffect

__all__ = ["Problem", "rows_of"]

Array = NDArray[np.float64]


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
class Problem:
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
    def of(cls, data: Data, hypothesis: Hypothesis, numbers: Array) -> Problem:
        rows = rows_of(data, hypothesis.terms, range(data.fitted))
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
        return self.freeing([False] * len(self.terms))

    def freeing(self, moving: Sequence[bool]) -> Layout:
        """The layout in which terms that do not move keep the numbers of which the rows are not linear."""
        count, free = self.data.start.size, self.layout.free.copy()
        free[count:] = [own or term.is_linear(p) for term, own in zip(self.terms, moving) for p in term.free]
        return replace(self.layout, free=free)

    def energy_at(self, numbers: Array) -> Array:
        """Squared residual of each joint with these standard model parameters and the present terms."""
        found = np.zeros_like(self.begin)
        found[: numbers.size] = numbers
        return self.total.energy(found)

    def errors(self, apart: Mapping[int, Array]) -> Array:
        """Squared error of each block and joint, by the parameters of its fold, shape (B, n)."""
        found = np.empty_like(self.data.counts)
        held = range(self.data.fitted, len(self.data.designs))
        rows = {**self.rows, **rows_of(self.data, self.terms, held)}
        for fold, run, numbers in _neighbours(self.data):
            x, cuts = apart[fold], _cuts(self.data, numbers)
            for k, joint in enumerate(rows[run]):
                part = slice(cuts[0], cuts[-1])
                left = joint.target[part] - joint.columns[part] @ x[joint.acts]
                found[numbers, k] = _sums(left**2, cuts)
        return found

    def scores(self, x: Array, weight: Array) -> Array:
        """Gradient of the log-likelihood of each fitted block, shape (B, Y)."""
        found = np.zeros((len(self.data.blocks), x.size))
        for fold, run, numbers in _neighbours(self.data):
            if fold == HELD_OUT:
                continue
            cuts = _cuts(self.data, numbers)
            part = slice(cuts[0], cuts[-1])
            for k, joint in enumerate(self.rows[run]):
                columns = joint.columns[part]
                left = joint.target[part] - columns @ x[joint.acts]
                found[np.ix_(numbers, joint.acts)] += weight[k] * _sums(left[:, None] * columns, cuts)
        return found[self.data.seen]


def _neighbours(data: Data) -> Iterator[tuple[int, int, Places]]:
    """Fold, recording and numbers of blocks of one fold that follow each other in one recording."""
    for (fold, run), blocks in groupby(enumerate(data.blocks), key=lambda one: (one[1].fold, one[1].run)):
        yield fold, run, np.array([number for number, _ in blocks])


def _cuts(data: Data, numbers: Places) -> Places:
    """Rows at which neighbouring blocks begin, and the end of the last one."""
    rows = [data.blocks[number].rows for number in numbers]
    return np.array([*(own.start for own in rows), rows[-1].stop])


def _sums(values: Array, cuts: Places) -> Array:
    """Sums of rows between cuts, the first of which is the first row; zero of none."""
    starts = cuts[:-1] - cuts[0]
    if not len(values):
        return np.zeros((starts.size, *values.shape[1:]))
    found = np.add.reduceat(values, np.minimum(starts, len(values) - 1), axis=0)
    found[np.diff(cuts) == 0] = 0.0
    return np.asarray(found)


def rows_of(data: Data, terms: Sequence[Term], runs: Sequence[int]) -> dict[int, list[_Joint]]:
    """Rows of some recordings, joint by joint, whose parameters are the same in all of them."""
    for run in runs:
        data.terms.prepare(terms, run)
    made = {run: [data.terms.acting(term, run) for term in terms] for run in runs}
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
    rows, size = np.maximum(total.count, 1.0), np.maximum(data.size, 1e-300)
    for k, (own, gram) in enumerate(zip(total.acts, total.gram)):
        added = own >= first
        ratio = np.sqrt(np.diagonal(gram)[added] / rows[k]) / size[k]
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
        beams=base.beams,
        scale=np.concatenate([base.scale, np.zeros(len(each))]),
        beside=None if any(isinstance(t.effect, BodyEffect) for t in hypothesis.terms) else base.beside,
    )
    return layout, start
