"""Predicted gain of every candidate by one linear step: all of them in one pass over the residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Candidate
from missing_physics.inference.data import HELD_OUT, Data
from missing_physics.inference.fit import Fit, residuals
from missing_physics.inference.ledger import ODDS
from missing_physics.standard import MODEL_ERROR

__all__ = ["Look", "Screen"]

Array = NDArray[np.float64]

#: Ridge of columns of unit length.
RIDGE = 1e-6


@dataclass(frozen=True)
class Look:
    """A candidate and its predicted gain of log score in folds that are left out [nats]."""

    candidate: Candidate
    gain: float


class Screen:
    """Residual of a fit, and projection of columns onto the complement of those of the fit.

    Args:
        data: the rows.
        fit: the fit to which candidates are added.
        shares: ratio of independent samples to samples at each joint, shape (n,).
    """

    def __init__(self, data: Data, fit: Fit, shares: Array) -> None:
        self.data, self.shares = data, shares
        self.weight, free = 1.0 / fit.sigma, fit.layout.free
        self.columns, self.left = [], []
        self.seen = [data.rows_seen(i) for i in range(data.fitted)]
        for i, seen in enumerate(self.seen):
            terms = [data.columns(t, i)[:, :, 1:] for t in fit.hypothesis.terms]
            whole = np.concatenate([data.designs[i], *terms], axis=2)[:, :, free]
            self.columns.append(np.where(seen[:, None, None], whole, 0.0) * self.weight[:, None])
            self.left.append(np.where(seen[:, None], residuals(data, fit, i), 0.0) * self.weight)
        size = fit.layout.size[free]
        scaled = fit.hessian * np.outer(size, size)
        scaled += 1e-9 * np.trace(scaled) / max(len(scaled), 1) * np.eye(len(scaled))
        self.inverse = np.linalg.inv(scaled) * np.outer(size, size)
        blocks = [b for b in data.blocks if b.fold != HELD_OUT]
        self.folds = np.array([b.fold for b in blocks])
        self.rows = [(b.run, b.rows) for b in blocks]
        self.square = np.sum([(left**2).sum(axis=0) for left in self.left], axis=0)
        self.count = np.sum([b.count for b in blocks], axis=0)

    def best(self, options: Sequence[Candidate]) -> list[Look]:
        """The best start of every effect at every place, most promising first.

        Parameters of a law in the robot file that are estimated pay their prior odds, but for one.
        """
        found: dict[tuple[object, ...], Look] = {}
        for option in options:
            gain = self.gain(option) - ODDS * max(option.numbers - 1, 0)
            key = (option.term.key, option.term.run)
            if key not in found or gain > found[key].gain:
                found[key] = Look(option, gain)
        return sorted(found.values(), key=lambda look: -look.gain)

    def gain(self, option: Candidate) -> float:
        """Gain of log score where a candidate's columns are fitted to the other folds [nats]."""
        linear = any(p.linear for p in option.term.free) or bool(option.numbers)
        own = [
            np.where(seen[:, None, None], self.data.columns(option.term, i), 0.0)[:, :, int(linear) :]
            * self.weight[:, None]
            for i, seen in enumerate(self.seen)
        ]
        felt = np.sqrt(sum((c**2).sum(axis=0) for c in own))
        size = np.sqrt((felt**2).sum(axis=0))
        if not np.all(np.isfinite(size)) or not size.any():
            return -np.inf
        size = np.maximum(size, 1e-300)
        own = [c / size for c in own]
        acts = np.flatnonzero(felt.any(axis=1))  # all other joints' columns are zero
        across = sum(
            np.einsum("tjx,tjc->xc", a[:, acts], c[:, acts], optimize=True) for a, c in zip(self.columns, own)
        )
        taken = self.inverse @ across
        fresh = [c - a @ taken for a, c in zip(self.columns, own)]
        gram = np.array([np.einsum("tjc,tjd->jcd", fresh[i][s], fresh[i][s]) for i, s in self.rows])
        right = np.array([np.einsum("tjc,tj->jc", fresh[i][s], self.left[i][s]) for i, s in self.rows])
        change = np.zeros_like(self.square)
        names = np.unique(self.folds)
        inside = self.folds == names[:, None]
        fitted = ~inside | option.term.effect.is_event  # other folds do not determine an event
        grams = np.tensordot(fitted.astype(float), gram.sum(axis=1), 1)
        if not np.all(np.isfinite(grams)):
            return -np.inf
        inverses = np.linalg.pinv(grams + RIDGE * np.eye(size.size), hermitian=True)
        thetas = np.einsum("fcd,fd->fc", inverses, np.tensordot(fitted.astype(float), right.sum(axis=1), 1))
        for own_fold, theta in zip(inside, thetas):
            g, b = gram[own_fold].sum(axis=0), right[own_fold].sum(axis=0)
            change += np.einsum("jcd,c,d->j", g, theta, theta) - 2.0 * b @ theta
        own_error = (MODEL_ERROR * self.data.torque * self.weight) ** 2 * self.count
        good = self.count > 0.0
        before = (self.square + own_error)[good]
        after = np.maximum(before + change[good], 1e-9 * before)
        return float(np.sum(-0.5 * (self.shares * self.count)[good] * np.log(after / before)))
