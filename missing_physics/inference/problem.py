"""Normal equations of one hypothesis, linearised at the present parameters of its terms."""

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
    """Rows of one joint in one recording; zero where nothing is compared.

    Attributes:
        active: indices of the parameters on which its torque depends, the terms' last, shape (u,).
        columns: derivatives by these parameters, shape (K, u).
        target: recorded torque minus that of the terms, shape (K,).
        has_terms: whether a term contributes to this joint.
    """

    active: Places
    columns: Array
    target: Array
    has_terms: bool


@dataclass(frozen=True)
class Problem:
    """Normal equations of the fitted rows, linearised at the present parameters of the terms.

    Attributes:
        data: the rows.
        terms: the terms of the hypothesis.
        layout: of the standard model's parameters and the changes of the terms' parameters.
        begin: starting values of the fit, shape (Y,).
        rows: of each fitted recording, joint by joint.
        total: normal equations of all fitted rows.
    """

    data: Data
    terms: tuple[Term, ...]
    layout: Layout
    begin: Array
    rows: Mapping[int, Sequence[_Joint]]
    total: Normal

    @classmethod
    def of(cls, data: Data, hypothesis: Hypothesis, parameters: Array) -> Problem:
        rows = rows_of(data, hypothesis.terms, range(data.fitted))
        total = _normal(data, rows, hypothesis.terms)
        layout, begin = _extended(data, hypothesis, parameters, _relative_rms(total, data))
        return cls(data, hypothesis.terms, layout, begin, rows, total)

    @cached_property
    def folds(self) -> dict[int, Normal]:
        """Normal equations of each fitted fold."""
        return {fold: _normal(self.data, self.rows, self.terms, fold) for fold in self.data.folds}

    @property
    def linear(self) -> Layout:
        """The layout with all non-linear parameters held fixed, so that one Newton step is exact."""
        return self.freeing([False] * len(self.terms))

    def freeing(self, moving: Sequence[bool]) -> Layout:
        """The layout with the non-linear parameters of some terms held fixed.

        Args:
            moving: for each term, whether its non-linear parameters are free.
        """
        count, free = self.data.start.size, self.layout.free.copy()
        free[count:] = [own or term.is_linear(p) for term, own in zip(self.terms, moving) for p in term.free]
        return replace(self.layout, free=free)

    @cached_property
    def proximal(self) -> Array:
        """Curvature that only limits steps, of parameters with no prior but their range, shape (Y,)."""
        found, first = np.zeros_like(self.begin), self.data.start.size
        each = [(term, p) for term in self.terms for p in term.free]
        for i, (term, p) in enumerate(each, start=first):
            if not p.linear and not term.is_given and prior_of(term, p) is None:
                low, high = term.range_of(p)
                found[i] = self.layout.width[i] ** -2.0 - max(high - low, np.finfo(float).tiny) ** -2.0
        return np.maximum(found, 0.0)

    def spread(self, term: Term) -> Array:
        """Width of what is known in advance of a term's parameters, shape (P,).

        It is that of the prior; else, of a force, that with which it is as large as the joint's torque; else
        the room that the recordings leave; else the typical value, or the estimate if that is larger.
        """
        first = self.data.start.size + sum(len(t.free) for t in self.terms[: self.terms.index(term)])
        found = self.layout.width[first : first + len(term.free)].copy()
        narrowed = {name for name, _, _ in term.limits}
        for i, p in enumerate(term.free):
            if term.is_given or prior_of(term, p) is not None:
                continue
            if p.linear:
                found[i] = 1.0 / max(self._peak(first + i), np.finfo(float).tiny)
            else:
                low, high = term.range_of(p)
                usual = max(abs(term.parameters[p.name]), p.typical)
                found[i] = high - low if p.name in narrowed else usual
        return np.maximum(found, np.finfo(float).tiny)

    def _peak(self, place: int) -> float:
        """Largest value of a parameter's column, relative to the rms of the torque at its joint."""
        found = 0.0
        for joints in self.rows.values():
            for joint, size in zip(joints, self.data.size):
                own = joint.columns[:, joint.active == place]
                found = max(found, float(np.abs(own).max(initial=0.0)) / size)
        return found

    def energy_at(self, parameters: Array) -> Array:
        """Squared residual of each joint with these standard model parameters and the present terms."""
        found = np.zeros_like(self.begin)
        found[: parameters.size] = parameters
        return self.total.energy(found)

    def errors(self, by_fold: Mapping[int, Array]) -> Array:
        """Squared error of each block and joint with the parameters fitted without its fold, (B, n)."""
        found = np.empty_like(self.data.counts)
        held = range(self.data.fitted, len(self.data.designs))
        rows = {**self.rows, **rows_of(self.data, self.terms, held)}
        for fold, run, numbers in _neighbours(self.data):
            x, cuts = by_fold[fold], _cuts(self.data, numbers)
            for k, joint in enumerate(rows[run]):
                part = slice(cuts[0], cuts[-1])
                residual = joint.target[part] - joint.columns[part] @ x[joint.active]
                found[numbers, k] = _sums(residual**2, cuts)
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
                residual = joint.target[part] - columns @ x[joint.active]
                found[np.ix_(numbers, joint.active)] += weight[k] * _sums(residual[:, None] * columns, cuts)
        return found[self.data.fitted_blocks]


def _neighbours(data: Data) -> Iterator[tuple[int, int, Places]]:
    """Fold, recording and numbers of consecutive blocks of one fold in one recording."""
    for (fold, run), blocks in groupby(enumerate(data.blocks), key=lambda one: (one[1].fold, one[1].run)):
        yield fold, run, np.array([number for number, _ in blocks])


def _cuts(data: Data, numbers: Places) -> Places:
    """First row of each of some consecutive blocks, and the end of the last one."""
    rows = [data.blocks[number].rows for number in numbers]
    return np.array([*(own.start for own in rows), rows[-1].stop])


def _sums(values: Array, cuts: Places) -> Array:
    """Sums of rows between cuts, counted from the first cut; zero where there are no rows."""
    starts = cuts[:-1] - cuts[0]
    if not len(values):
        return np.zeros((starts.size, *values.shape[1:]))
    found = np.add.reduceat(values, np.minimum(starts, len(values) - 1), axis=0)
    found[np.diff(cuts) == 0] = 0.0
    return np.asarray(found)


def rows_of(data: Data, terms: Sequence[Term], runs: Sequence[int]) -> dict[int, list[_Joint]]:
    """Rows of some recordings, joint by joint; a joint's parameters are the same in all of them."""
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
        active = np.concatenate([data.active[k], *(np.arange(ends[t], ends[t + 1]) for t in numbers)])
        for run in runs:
            target, columns = data.target(run)[:, k], [data.active_columns[run][k]]
            for t in numbers:
                joints, values = made[run][t]
                own = values[:, joints == k].sum(axis=1)  # zero if it contributes nothing in this recording
                target = target - own[:, 0]
                columns.append(own[:, 1:])
            found[run].append(_Joint(active, np.concatenate(columns, axis=1), target, bool(numbers)))
    return found


def _normal(
    data: Data, rows: Mapping[int, Sequence[_Joint]], terms: Sequence[Term], fold: int | None = None
) -> Normal:
    """Normal equations of one fold or of all fitted rows; joints without terms reuse those of the data."""
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
    return Normal(
        tuple(joint.active for joint in joints), tuple(gram), tuple(right), square, alone.count, size
    )


def _relative_rms(total: Normal, data: Data) -> Array:
    """Ratio of the rms of every term's column to that of the torque, at the joint where it is largest."""
    first = data.start.size
    found = np.zeros(total.size - first)
    rows, size = np.maximum(total.count, 1.0), np.maximum(data.size, 1e-300)
    for k, (own, gram) in enumerate(zip(total.active, total.gram)):
        added = own >= first
        ratio = np.sqrt(np.diagonal(gram)[added] / rows[k]) / size[k]
        found[own[added] - first] = np.maximum(found[own[added] - first], ratio)
    return found


def _extended(
    data: Data, hypothesis: Hypothesis, parameters: Array, relative_rms: Array
) -> tuple[Layout, Array]:
    """Layout of the standard model's parameters and the terms' changes, and starting values of a fit."""
    base, each = data.layout, [(term, p) for term in hypothesis.terms for p in term.free]
    start, free = np.concatenate([parameters, np.zeros(len(each))]), base.free.copy()
    middle, spread = base.centre.copy(), base.width.copy()
    for name in hypothesis.from_file - {BODIES}:
        place = base.names.index(name)
        value = data.file_values[place]
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
        size[i] = 1.0 / relative_rms[i] if relative_rms[i] > 0.0 else max(abs(value), p.typical)
        if not p.linear:
            size[i] = min(size[i], 0.5 * max(abs(value), 1e-3 * p.typical))
        known = prior_of(term, p)
        expected = (p.absent or 0.0) if p.linear else value
        if term.is_given:  # prior centred on the robot file's value, as wide as that value
            expected = term.file_value(p.name)
            known = (expected, abs(expected)) if expected != 0.0 else None
        centre[i], width[i] = (expected - value, size[i]) if known is None else (known[0] - value, known[1])
        size[i] = min(size[i], width[i])
    count = len(base.names)
    layout = Layout(
        names=(*base.names, *(f"{term.effect.id}@{term.at}.{p.name}" for term, p in each)),
        start=np.concatenate([base.start, np.zeros(len(each))]),
        free=np.concatenate([free, np.ones(len(each), dtype=bool)]),
        bodies=base.bodies,
        gaussian=np.concatenate([[i for i in base.gaussian if free[i]], count + np.arange(len(each))]).astype(
            int
        ),
        positive=positive,
        size=np.concatenate([base.size, size]),
        centre=np.concatenate([middle, centre]),
        width=np.concatenate([spread, width]),
        beams=base.beams,
        scale=np.concatenate([base.scale, np.zeros(len(each))]),
        extra=None if any(isinstance(t.effect, BodyEffect) for t in hypothesis.terms) else base.extra,
    )
    return layout, start
