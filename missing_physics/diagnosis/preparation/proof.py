"""Step 6 of the chain: every finding must lower the error on data it was not fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates.structural import hidden
from missing_physics.diagnosis.least_squares.explanation import Explanation, View, explain
from missing_physics.diagnosis.least_squares.model_error import within_accuracy
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.statistics.blocks import block_columns
from missing_physics.diagnosis.statistics.correlated_errors import paired_block_p_value
from missing_physics.diagnosis.terms.term import Term

__all__ = ["SIGNIFICANCE", "SILENT", "UNCONFIRMED", "HeldOut", "held_out_blocks", "held_out_rows", "proven"]

Array = NDArray[np.float64]

#: Largest p-value of the bootstrap over held-out blocks.
SIGNIFICANCE = 0.05
#: Words of a refusal by held-out data.
UNCONFIRMED = "does not lower the held-out error"
#: Mean square of what a term adds in held-out data over that in fitted data; below it they cannot judge it.
SILENT = 1e-3
#: Without validation recordings one stretch in this many is held out.
HELD_OUT_STRETCHES = 16
EVERY = 4


@dataclass(frozen=True)
class HeldOut:
    """Data that no fit has seen.

    Attributes:
        problem: the recordings.
        rows: which of its rows count, shape (R,).
        scale: errors are divided by it, shape (n,).
    """

    problem: Problem
    rows: NDArray[np.bool_]
    scale: Array

    def residual(self, explanation: Explanation) -> Array:
        """Measured minus predicted with every parameter held, shape (R, n)."""
        left = self.problem.measured - explanation.predict(self.problem)
        return np.asarray(left - self._starts(explanation, left))

    def _starts(self, explanation: Explanation, left: Array) -> Array:
        """What the starts of hidden modes in these recordings explain of `left`, shape (R, n).

        How a mode moves when a recording begins is a number of the recording and of no model; where the
        recording was not fitted it is estimated here, a few numbers of thousands of samples.
        """
        columns = [
            np.concatenate([segment.hidden.unknown_starts(term) for segment in self.problem.segments])
            for term in explanation.found
            if hidden(term.effect)
        ]
        if not sum(part.shape[2] for part in columns):
            return np.zeros_like(left)
        made = block_columns(np.concatenate(columns, axis=2), self.problem.segment_of)
        weight = (self.problem.sliding / self.scale)[self.rows][:, self.problem.usable]
        known = (made[self.rows][:, self.problem.usable] * weight[:, :, None]).reshape(-1, made.shape[2])
        target = (left[self.rows][:, self.problem.usable] * weight).ravel()
        return np.asarray(made @ np.linalg.lstsq(known, target, rcond=1e-9)[0])

    def silent(self, explanation: Explanation, term: Term) -> bool:
        """Whether `term` acts in the fitted data and next to nowhere in these, which then cannot judge it."""
        every = np.ones(explanation.problem.time.size, dtype=bool)
        there = self._strength(explanation.problem, every, explanation, term)
        return self._strength(self.problem, self.rows, explanation, term) < SILENT * there

    def acts(self, explanation: Explanation, terms: Sequence[Term]) -> NDArray[np.bool_]:
        """Outputs to which some of the terms add anything here, all usable ones where none does, shape (n,).

        Errors elsewhere, such as those of a base's rates, say nothing of them and may be large.
        """
        found = np.zeros_like(self.problem.usable)
        for term in terms:
            for segment in self.problem.segments:
                found |= segment.contribution(term, explanation.terms).value.any(axis=0)
        return found & self.problem.usable if (found & self.problem.usable).any() else self.problem.usable

    def _strength(
        self, problem: Problem, rows: NDArray[np.bool_], explanation: Explanation, term: Term
    ) -> float:
        made = np.concatenate([s.contribution(term, explanation.terms).value for s in problem.segments])
        return float(np.mean((made / self.scale * problem.sliding)[rows][:, problem.usable] ** 2))

    def refusal(self, before: Explanation, after: Explanation) -> str:
        """Why `after` is no better than `before` on these data; empty when it is, or when they cannot say.

        They cannot where what `after` adds does not act in them.
        """
        known = {term.key for term in before.terms}
        fresh = [term for term in after.found if term.key not in known]
        if any(self.silent(after, term) for term in fresh):
            return ""
        where = self.acts(after, fresh)
        p_value = paired_block_p_value(
            self.block_energies(self.residual(before), where),
            self.block_energies(self.residual(after), where),
        )
        return "" if p_value <= SIGNIFICANCE else f"{UNCONFIRMED} (p = {p_value:.2g})"

    def rms(self, residual: Array, joint: str) -> str:
        """The residual of `joint` in its unit, or of all joints in units of the scale, in words."""
        weight = self.problem.sliding[self.rows]
        if joint in self.problem.joints:
            k = self.problem.joints.index(joint)
            level = np.sqrt((residual[self.rows, k] ** 2 * weight[:, k]).sum() / max(weight[:, k].sum(), 1.0))
            prismatic = self.problem.robot.joint(joint).kind == "prismatic"
            return f"{level:.3g} {'N' if prismatic else 'N m'}"
        counted = (residual / self.scale)[self.rows][:, self.problem.usable]
        return f"{np.sqrt((counted**2 * weight[:, self.problem.usable]).mean()):.3g} (whitened)"

    def block_energies(self, residual: Array, outputs: NDArray[np.bool_] | None = None) -> Array:
        """Whitened energy of each block that counts, of these outputs or of all usable ones."""
        used = self.problem.usable if outputs is None else outputs
        counted = (residual / self.scale * self.problem.sliding)[:, used]
        weighted = (counted**2).sum(1)
        blocks = self.problem.blocks[self.rows]
        _, index = np.unique(blocks, return_inverse=True)
        return np.asarray(np.bincount(index, weighted[self.rows]), dtype=np.float64)


def held_out_blocks(problem: Problem) -> NDArray[np.bool_]:
    """Rows held out when there is no validation recording: one stretch in four of every recording."""
    rows = np.zeros(problem.time.size, dtype=bool)
    for number in range(len(problem.segments)):
        own = np.flatnonzero(problem.segment_of == number)
        rows[own[held_out_rows(own.size)]] = True
    return rows


def held_out_rows(count: int) -> NDArray[np.bool_]:
    """Which of the rows of one recording are held out, shape (`count`,)."""
    stretch = (np.arange(count) * HELD_OUT_STRETCHES) // max(count, 1)
    return np.asarray(stretch % EVERY == EVERY // 2)


def proven(
    explanation: Explanation,
    view: View,
    held_out: HeldOut,
    *,
    nuisance: bool,
) -> tuple[Explanation, dict[tuple[str, str], float], tuple[tuple[Term, str], ...]]:
    """Drop terms that do not lower the held-out error, the least useful first; before that `within_accuracy`.

    An effect that the robot has already is not dropped but goes back to the robot file's parameters.

    Returns:
        The explanation that is left; the relative fall of the held-out energy that each of its terms brings;
        and the dropped terms with the reason.
    """
    current, dropped = _beyond_accuracy(explanation, view, nuisance=nuisance)
    while True:
        left = held_out.residual(current)
        with_all = held_out.block_energies(left)
        gains: dict[tuple[str, str], float] = {}
        worst: tuple[float, Term, Explanation] | None = None
        for term in _proved_terms(current, held_out):
            without = explain(current.problem, view, current.terms_without(term), nuisance=nuisance)
            other = held_out.residual(without)
            before = held_out.block_energies(other)
            where = held_out.acts(current, [term])
            p_value = paired_block_p_value(*(held_out.block_energies(r, where) for r in (other, left)))
            gains[term.key] = 1.0 - float(with_all.sum() / max(before.sum(), 1e-300))
            if p_value > SIGNIFICANCE and (worst is None or p_value > worst[0]):
                worst = (p_value, term, without)
        if worst is None:
            return current, gains, tuple(dropped)
        p_value, term, current = worst
        dropped.append((term, f"it fits the training data but {UNCONFIRMED} (p = {p_value:.2g})"))


def _beyond_accuracy(
    explanation: Explanation, view: View, *, nuisance: bool
) -> tuple[Explanation, list[tuple[Term, str]]]:
    """The explanation without terms that do less than the model of bending links is good for."""
    dropped: list[tuple[Term, str]] = []
    if not explanation.problem.robot.flexible_links:
        return explanation, dropped
    current = explanation
    for term in explanation.found:
        without = explain(current.problem, view, current.terms_without(term), nuisance=nuisance)
        if within_accuracy(current, without):
            dropped.append((term, "it does less than the error of a model of links that bend"))
            current = without
    return current, dropped


def _proved_terms(explanation: Explanation, held_out: HeldOut) -> Sequence[Term]:
    """Found terms that unseen data can confirm: an event is over before they begin, others may not act."""
    return [t for t in explanation.found if not (t.effect.is_event or held_out.silent(explanation, t))]
