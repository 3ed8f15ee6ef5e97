"""Screening: predicted gain of each candidate by one linear step, without fitting it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Candidate
from missing_physics.inference.data import HELD_OUT, Data
from missing_physics.inference.fit import RIDGE, Fit, of_one_fold, residuals
from missing_physics.inference.ledger import ODDS
from missing_physics.inference.problem import rows_of
from missing_physics.inference.score import unpredicted

__all__ = ["Screen", "ScreenedCandidate"]

Array = NDArray[np.float64]

#: Candidates whose columns are computed together: filtering several costs as much as one, but needs memory.
TOGETHER = 32


@dataclass(frozen=True)
class ScreenedCandidate:
    """A candidate and its predicted gain in cross-validated log score [nats]."""

    candidate: Candidate
    gain: float


class Screen:
    """Residual of a fit, and projection of candidates' columns onto the complement of the fit's columns.

    Args:
        data: the rows.
        fit: the fit to which candidates are added.
        shares: ratio of independent samples to samples at each joint, shape (n,).
    """

    def __init__(self, data: Data, fit: Fit, shares: Array) -> None:
        self.data, self.shares = data, shares
        self.weight, free = 1.0 / fit.sigma, fit.layout.free
        self.fitted_rows = [data.fitted_rows(i) for i in range(data.fitted)]
        self.active, self.columns = _columns(data, fit, self.fitted_rows)
        self.residual = [
            np.where(fitted_rows[:, None], residuals(data, fit, i), 0.0) * self.weight
            for i, fitted_rows in enumerate(self.fitted_rows)
        ]
        size = fit.layout.size[free]
        scaled = fit.hessian * np.outer(size, size)
        scaled += RIDGE * np.trace(scaled) / max(len(scaled), 1) * np.eye(len(scaled))
        self.inverse = np.linalg.inv(scaled) * np.outer(size, size)
        self.folds = {fold: data.stretches(fold) for fold in data.folds}
        self.square = np.sum([(residual**2).sum(axis=0) for residual in self.residual], axis=0)
        self.count = np.sum([b.count for b in data.blocks if b.fold != HELD_OUT], axis=0)

    def best(self, options: Sequence[Candidate]) -> list[ScreenedCandidate]:
        """The best starting values of every effect at every place and signal, most promising first.

        A candidate that frees several parameters of a law in the robot file pays prior odds for all but one.
        """
        found: dict[tuple[object, ...], ScreenedCandidate] = {}
        for number, option in enumerate(options):
            if number % TOGETHER == 0:
                for i in range(self.data.fitted):
                    self.data.terms.prepare([every.term for every in options[number : number + TOGETHER]], i)
            gain = max(self.gain(option), option.expected) - ODDS * max(option.freed_count - 1, 0)
            key = (option.term.key, option.term.run, option.term.along)
            if key not in found or gain > found[key].gain:
                found[key] = ScreenedCandidate(option, gain)
        return sorted(found.values(), key=lambda option: -option.gain)

    def gain(self, option: Candidate) -> float:
        """Gain in log score of each fold with a candidate's columns fitted to the other folds [nats]."""
        own = self._own(option)
        norms = np.sqrt(sum((c**2).sum(axis=1) for c in own))
        size = np.sqrt((norms**2).sum(axis=0))
        if not np.all(np.isfinite(size)) or not size.any():
            return -np.inf
        size = np.maximum(size, 1e-300)
        gram, right = self._projected([c / size for c in own], np.flatnonzero(norms.any(axis=1)))
        change = np.zeros_like(self.square)
        fitted = 1.0 - np.eye(len(self.folds))
        effect, information = option.term.effect, np.einsum("fjcc->fc", gram)
        if effect.is_event or (
            effect.is_beyond and of_one_fold(information).any()
        ):  # no other fold determines it
            fitted = np.ones_like(fitted)
        grams = np.tensordot(fitted, gram.sum(axis=1), 1)
        if not np.all(np.isfinite(grams)):
            return -np.inf
        aims = np.tensordot(fitted, right.sum(axis=1), 1)
        inverses = np.linalg.pinv(grams + RIDGE * np.eye(size.size), hermitian=True)
        thetas = np.einsum("fcd,fd->fc", inverses, aims)
        for g, b, theta in zip(gram, right, thetas):
            change += np.einsum("jcd,c,d->j", g, theta, theta) - 2.0 * b @ theta
        model_error = (self.data.error * self.weight) ** 2 * self.count
        good = self.count > 0.0
        before = (self.square + model_error)[good]
        after = np.maximum(before + change[good], 1e-9 * before)
        gained = -0.5 * (self.shares * self.count)[good] * np.log(after / before)
        if option.term.effect.cuts_torque:  # it predicts nothing of what it cuts off
            cut = self.data.cut((option.term,))[self.data.fitted_blocks].sum(axis=0)[good]
            level = after / self.count[good] / self.weight[good] ** 2
            gained -= unpredicted(self.shares[good] * cut, self.data.size[good], level)
        return float(gained.sum())

    def _own(self, option: Candidate) -> list[Array]:
        """Weighted columns of a candidate in the fitted rows of each recording, shape (n, K, C)."""
        linear = any(p.linear for p in option.term.free) or bool(option.freed_count)
        found = []
        for i, fitted_rows in enumerate(self.fitted_rows):
            active, values = self.data.terms.acting(option.term, i)
            own = np.zeros((self.weight.size, fitted_rows.size, values.shape[2] - int(linear)))
            weighted = values[:, :, int(linear) :] * self.weight[active, None]
            own[active] = np.where(fitted_rows[:, None, None], weighted, 0.0).transpose(1, 0, 2)
            found.append(own)
        return found

    def _projected(self, own: Sequence[Array], active: NDArray[np.int_]) -> tuple[Array, Array]:
        """Products of a candidate's projected columns with each other and with the residual.

        Args:
            own: columns in each recording, shape (n, K, C).
            active: joints at which they are not zero.

        Returns:
            Products for each fold and joint, shapes (F, n, C, C) and (F, n, C).
        """
        across = np.zeros((len(self.inverse), own[0].shape[2]))
        for k in active:
            for columns, c in zip(self.columns, own):
                across[self.active[k]] += columns[k].T @ c[k]
        taken = self.inverse @ across
        fresh = []
        for columns, c in zip(self.columns, own):
            fresh.append(c.copy())
            for k, places in enumerate(self.active):
                fresh[-1][k] -= columns[k] @ taken[places]
        gram, right = [], []
        for stretches in self.folds.values():
            parts = [(fresh[i][:, rows], self.residual[i][rows].T) for i, rows in stretches]
            gram.append(sum(one.transpose(0, 2, 1) @ one for one, _ in parts))
            right.append(sum((residual[:, None] @ one)[:, 0] for one, residual in parts))
        return np.array(gram), np.array(right)


def _columns(
    data: Data, fit: Fit, fitted_rows: Sequence[NDArray[np.bool_]]
) -> tuple[list[NDArray[np.int_]], list[list[Array]]]:
    """Weighted columns of a fit at each joint in the fitted rows, and their indices among free parameters.

    Returns:
        For each joint the indices, shape (u,); for each recording and joint the columns, shape (K, u).
    """
    free = fit.layout.free
    place = np.cumsum(free) - 1
    rows = rows_of(data, fit.hypothesis.terms, range(len(fitted_rows)))
    kept = [free[joint.active] for joint in rows[0]]
    active = [place[joint.active[own]] for joint, own in zip(rows[0], kept)]
    columns = [
        [
            np.where(fitted[:, None], joint.columns[:, own] / sigma, 0.0)
            for joint, own, sigma in zip(rows[i], kept, fit.sigma)
        ]
        for i, fitted in enumerate(fitted_rows)
    ]
    return active, columns
