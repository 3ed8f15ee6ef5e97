"""Fitting one explanation: a set of terms together with the robot's own inertial numbers.

The nominal numbers are re-estimated with every explanation, because somebody may have tuned them before and
the tuning has absorbed part of what is missing. All parameters are found together by Gauss-Newton with
exact Jacobians; parameters in which the model is linear need one step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.least_squares.view import View
from missing_physics.diagnosis.statistics.correlated_errors import BlockedRegression, effective_samples
from missing_physics.diagnosis.terms.term import Term, in_order
from reference_model.effects.base import JointEffect
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.structure import StructureEffect

__all__ = ["FEWEST_FREEDOM", "TOLD", "Explanation", "View", "explain"]

Array = NDArray[np.float64]

#: What acts in fewer long blocks than this, counted by its energy, is told by short ones.
FEW_BLOCKS = 4.0
#: Gauss-Newton steps, and halvings of one step.
MOST_STEPS = 12
MOST_HALVINGS = 6
#: Relative fall of the sum of squares below which a fit has converged.
CONVERGED = 1e-5
#: A column whose length relative to the others is below this carries no information.
NEGLIGIBLE = 1e-9
#: Rows of a short block.
FINE_ROWS = 8
#: Blocks, less one, that must tell a parameter before they are left out one by one.
FEWEST_FREEDOM = 2.0
#: Standard deviations of a 95 % interval of what runs tell.
TOLD = 1.96
#: Keeps logarithms of energies finite.
TINY = 1e-300


@dataclass(frozen=True)
class Explanation:
    """A fitted set of terms.

    Attributes:
        problem, view: what it was fitted to.
        terms: with fitted parameters; nominal ones first.
        nuisance: coefficients of the inertial combinations, shape (B,).
        residual: measured minus predicted, in torque units, shape (R, n).
        columns: weighted Jacobian of [inertial combinations, term parameters], shape (R', K).
    """

    problem: Problem
    view: View
    terms: tuple[Term, ...]
    nuisance: Array
    residual: Array
    columns: Array

    @property
    def found(self) -> tuple[Term, ...]:
        """Terms that the nominal robot lacks."""
        return tuple(term for term in self.terms if not term.nominal)

    def terms_without(self, term: Term) -> list[Term]:
        """All terms but `term`, in whose place that of the robot file stands where it has one."""
        given = {(use.effect, use.at): use.parameters for use in self.problem.robot.effects}
        if term.key not in given:
            return [t for t in self.terms if t.key != term.key]
        own = replace(term, parameters={**term.parameters, **given[term.key]}, nominal=True, frozen=True)
        return [own if t.key == term.key else t for t in self.terms]

    @cached_property
    def errors(self) -> Array:
        """Weighted residual, shape (R', 1)."""
        return self.view.flatten(self.problem, self.residual[:, :, None])

    @cached_property
    def energies(self) -> Array:
        """Weighted residual energy of each usable joint."""
        per_joint = self.errors.reshape(-1, int(self.problem.usable.sum()))
        return np.asarray((per_joint**2).sum(0))

    @cached_property
    def effective(self) -> Array:
        """Effective number of samples of each usable joint."""
        per_joint = self.errors.reshape(-1, int(self.problem.usable.sum()))
        counted = self.view.weight(self.problem)[self.view.rows][:, self.problem.usable].mean(0)
        return counted * np.array([effective_samples(column) for column in per_joint.T])

    @cached_property
    def referred(self) -> Array:
        """Weighted residual energy of each usable joint, referred to the torque that is commanded.

        An actuator effect that explains a recording by letting hardly any torque through has explained
        nothing: errors count relative to the torque that is delivered. Noise of the torque's sensor does
        not go through the actuator, so that this part of the energy counts as it is.
        """
        acting = [t for t in self.terms if t.scales_torque]
        if not acting:
            return self.energies
        value, _ = self.problem.evaluate(acting)
        weight = self.view.weight(self.problem)
        commanded, delivered = (
            ((torque * weight)[self.view.rows][:, self.problem.usable] ** 2).sum(0)
            for torque in (self.problem.measured, self.problem.measured - value)
        )
        ratio = np.maximum(commanded, TINY) / np.maximum(delivered, TINY)
        driven = np.maximum(self.energies - self.view.aside(self.problem), 0.0)
        return self.energies + driven * (ratio - 1.0)

    @cached_property
    def noise(self) -> Array:
        """Weighted energy that the noise floor has, of each usable joint."""
        problem, view, used = self.problem, self.view, self.problem.usable
        rows = view.weight(problem)[view.rows][:, used].sum(axis=0)
        return np.asarray(rows * (problem.noise_floor[used] / view.scale[used]) ** 2)

    @property
    def size(self) -> int:
        """Number of estimated parameters, the inertial combinations included."""
        return self.nuisance.size + sum(len(term.free) for term in self.terms)

    @cached_property
    def regression(self) -> BlockedRegression:
        """The regression linearised at the fit, whose solution are the fitted values."""
        return self.regression_of(fine=False)

    def regression_of(self, *, fine: bool) -> BlockedRegression:
        """The linearised regression in long blocks, or in short ones that are left out alternately.

        Short blocks are for what happens once: no other stretch of time can foretell it, but every second
        moment of it can be foretold from the others.
        """
        fitted = np.concatenate([self.nuisance, *(term.values for term in self.terms)])
        target = self.errors[:, 0] + self.columns @ fitted
        prior = np.zeros(self.columns.shape[1])
        prior[: self.nuisance.size] = self.view.prior
        blocks = self.blocks_of(fine=fine)
        return BlockedRegression.of(self.columns, target, blocks, prior=prior, alternate=fine)

    def blocks_of(self, *, fine: bool) -> NDArray[np.int_]:
        """The long or the short block of each row of the columns."""
        blocks = self.view.blocks(self.problem)
        return np.arange(blocks.size) // (FINE_ROWS * int(self.problem.usable.sum())) if fine else blocks

    @cached_property
    def covariance(self) -> Array:
        """Covariance of [nuisance, parameters] by blocks, shape (K, K)."""
        return self._inference.covariance()

    @cached_property
    def _inference(self) -> BlockedRegression:
        """With something brief among the terms the blocks are short: one long block would hold all of it."""
        return self.regression_of(fine=any(self.is_brief(term) for term in self.found))

    def is_brief(self, term: Term) -> bool:
        """Whether few stretches of time tell of `term`: an event, or a push that is met here and there."""
        if term.effect.is_event or not isinstance(term.effect, (ForceEffect, JointEffect)):
            return term.effect.is_event
        value, _ = self.problem.evaluate([term])
        rows = (self.view.flatten(self.problem, value[:, :, None])[:, 0]) ** 2
        _, block = np.unique(self.view.blocks(self.problem), return_inverse=True)
        energy = np.bincount(block, rows)
        return float(energy.sum()) ** 2 < FEW_BLOCKS * float((energy**2).sum())

    def slice_of(self, term: Term) -> slice:
        """Where the parameters of `term` stand among the columns."""
        start = self.nuisance.size
        for other in self.terms:
            if other.key == term.key:
                return slice(start, start + len(other.free))
            start += len(other.free)
        raise KeyError(term.key)

    def intervals(self, term: Term) -> dict[str, tuple[float, float]]:
        """95 % confidence interval of each free parameter of `term`, which must be one of `terms`."""
        place = self.slice_of(term)
        directions = np.eye(self.columns.shape[1])[place]
        half = self._half_widths(directions)
        half = np.array([TOLD * term.held.get(name, h / TOLD) for name, h in zip(term.free, half)])
        return {name: (float(v - h), float(v + h)) for name, v, h in zip(term.free, term.values, half)}

    def rough_intervals(self, term: Term) -> dict[str, tuple[float, float]]:
        """The same by the blocks' scores: too narrow where few blocks tell a parameter.

        They guide a search that asks evidence and unseen data as well; they are never told.
        """
        inference, place = self._inference, self.slice_of(term)
        quantile = stats.t.ppf(0.975, max(inference.gram.shape[0] - 1, 2))
        half = quantile * np.sqrt(np.maximum(np.diagonal(self._scores)[place], 0.0))
        return {name: (float(v - h), float(v + h)) for name, v, h in zip(term.free, term.values, half)}

    @cached_property
    def _scores(self) -> Array:
        return self._inference.sandwich()

    def _half_widths(self, directions: Array) -> Array:
        """Half the 95 % interval of `directions` (m, K) . [nuisance, parameters], shape (m,).

        By the jackknife over blocks. What hardly more than one block tells, as when an event begins, nothing
        is left of without it: there errors count as large as everywhere else, at least as large as there.
        """
        inference = self._inference
        freedom = inference.freedom(directions)
        variance = np.einsum("mi,ij,mj->m", directions, self.covariance, directions)
        few = freedom < FEWEST_FREEDOM
        if few.any():
            level = inference.residual_energy() / max(float(self.effective.sum()) - self.size, 1.0)
            alike = np.maximum(
                level * np.einsum("mi,ij,mj->m", directions, inference.inverse(), directions),
                np.einsum("mi,ij,mj->m", directions, self._scores, directions),
            )
            variance = np.where(few, alike, variance)
            freedom = np.where(few, max(inference.gram.shape[0] - 1, 2), freedom)
        return np.asarray(stats.t.ppf(0.975, freedom) * np.sqrt(np.maximum(variance, 0.0)))

    def nuisance_interval(self, direction: Array) -> tuple[float, float]:
        """95 % interval of `direction` . nuisance, or of the combinations that runs tell."""
        centre, told = self.combination(direction), self.view.told
        if told is not None:
            half = TOLD * float(np.sqrt(direction @ told.covariance @ direction))
            return centre - half, centre + half
        whole = np.zeros((1, self.columns.shape[1]))
        whole[0, : self.nuisance.size] = direction
        half = float(self._half_widths(whole)[0])
        return centre - half, centre + half

    def combination(self, direction: Array) -> float:
        """`direction` . nuisance, or . the combinations that runs tell."""
        told = self.view.told
        return float(direction @ (self.nuisance if told is None else told.values))

    def predict(self, problem: Problem) -> Array:
        """Predicted torque of another problem with everything held, shape (R, n)."""
        value, _ = problem.evaluate(self.terms)
        inertial = problem.nuisance @ self.nuisance if self.nuisance.size else 0.0
        return np.asarray(problem.measured - problem.residual + value + inertial + self.view.known(problem))

    def evidence_over(self, simpler: Explanation, *, effective: Array | None = None) -> float:
        """Natural logarithm of the odds for this explanation against `simpler`.

        Difference of the Bayesian information criteria (Schwarz, Ann. Stat. 6 (1978) 461-464) with one
        noise level per joint and, in the place of the number of rows, the effective number of samples of
        what this explanation leaves: what it explains is no noise whose memory would count.
        Energies are those of `referred`. A mode that is simulated along the recorded motion is shaken by its
        noise and, damped enough, undoes that noise in the torques needed. So where there is one among the
        terms, what lies below the noise floor is no evidence for anything.

        Args:
            effective: effective samples per joint to count instead, where several are compared.
        """
        effective = self.effective if effective is None else effective
        least = np.full(effective.size, TINY)
        if any(isinstance(term.effect, StructureEffect) for term in (*self.found, *simpler.found)):
            least = np.maximum(self.noise, least)
        fall = np.log(np.maximum(simpler.referred, least) / np.maximum(self.referred, least))
        gain = 0.5 * effective @ fall
        return float(gain - 0.5 * (self.size - simpler.size) * np.log(max(effective.sum(), 2.0)))


def explain(problem: Problem, view: View, terms: Sequence[Term], *, nuisance: bool = True) -> Explanation:
    """Fit `terms` and the inertial combinations together, starting from the terms' parameter values.

    Args:
        nuisance: False keeps the robot's inertial numbers as they are, and so does a view that knows them.
    """
    free = nuisance and view.told is None
    inertial = problem.nuisance if free else np.zeros((*problem.residual.shape, 0))
    count = inertial.shape[2]
    # What is known beforehand counts as further rows: each combination, measured to be zero.
    fixed = np.vstack([view.flatten(problem, inertial), view.prior**0.5 * np.eye(count)])
    current = tuple(terms)
    state = _evaluate(problem, view, current, fixed)
    for number in range(MOST_STEPS):
        candidate = _step(problem, view, current, fixed, state, linear_only=number == 0)
        if candidate is None and number == 0:
            continue
        if candidate is None:
            break
        fall = state.energy - candidate[1].energy
        current, state = candidate
        if all(t.is_linear or t.frozen for t in current):
            break
        if number > 0 and fall <= CONVERGED * state.energy:
            break
    columns = np.column_stack([fixed, state.columns])[: fixed.shape[0] - count]
    residual = problem.residual - view.known(problem) - state.value - inertial @ state.nuisance
    return Explanation(problem, view, current, state.nuisance, residual, columns)


@dataclass(frozen=True)
class _State:
    value: Array
    columns: Array
    target: Array
    nuisance: Array
    energy: float


def _evaluate(problem: Problem, view: View, terms: Sequence[Term], fixed: Array) -> _State:
    value, jacobian = problem.evaluate(terms)
    extra = fixed.shape[1]
    columns = np.pad(view.flatten(problem, jacobian), ((0, extra), (0, 0)))
    left = problem.residual - view.known(problem) - value
    target = np.pad(view.flatten(problem, left[:, :, None])[:, 0], (0, extra))
    nuisance = _least_squares(fixed, target)
    rest = target - fixed @ nuisance
    return _State(value, columns, target, nuisance, float(rest @ rest))


def _step(
    problem: Problem,
    view: View,
    terms: tuple[Term, ...],
    fixed: Array,
    state: _State,
    *,
    linear_only: bool,
) -> tuple[tuple[Term, ...], _State] | None:
    """One damped Gauss-Newton step; None when nothing falls."""
    change = _bounded_change(terms, fixed, state, linear_only=linear_only)
    part = 1.0
    for _ in range(MOST_HALVINGS):
        moved, start = [], 0
        for term in terms:
            stop = start + len(term.free)
            moved.append(term.at_values(term.values + part * change[start:stop]))
            start = stop
        after = _evaluate(problem, view, moved, fixed)
        if after.energy < state.energy:
            return tuple(moved), after
        part /= 2.0
    return None


def _bounded_change(terms: tuple[Term, ...], fixed: Array, state: _State, *, linear_only: bool) -> Array:
    """Gauss-Newton change of the parameters; those that would leave their bounds stop there.

    Of two parameters in order the greater is counted from the smaller one, so that its bound is zero.
    """
    parameters = [p for term in terms for p in term.estimated]
    values = np.concatenate([term.values for term in terms]) if terms else np.zeros(0)
    lower = np.concatenate([term.bounds[0] for term in terms]) if terms else np.zeros(0)
    upper = np.concatenate([term.bounds[1] for term in terms]) if terms else np.zeros(0)
    columns = state.columns.copy()
    ordered = list(in_order(terms))
    held = np.array([p.name in term.held for term in terms for p in term.estimated], dtype=bool)
    for greater, smaller in ordered.copy():
        if held[greater] or held[smaller]:  # one stands, and bounds the other
            lower[greater] = max(lower[greater], values[smaller]) if held[smaller] else lower[greater]
            upper[smaller] = min(upper[smaller], values[greater]) if held[greater] else upper[smaller]
            ordered.remove((greater, smaller))
            continue
        columns[:, smaller] += columns[:, greater]
        values[greater] -= values[smaller]
        lower[greater], upper[greater] = 0.0, upper[greater] - lower[smaller]
    change = np.zeros(values.size)
    free = (np.linalg.norm(columns, axis=0) > NEGLIGIBLE) & ~held
    if linear_only:
        free &= np.array([p.linear for p in parameters], dtype=bool)
    for _ in range(values.size + 1):
        target = state.target - columns @ np.where(free, 0.0, change)
        solution = _least_squares(np.column_stack([fixed, columns[:, free]]), target)
        change[free] = solution[fixed.shape[1] :]
        outside = free & ((values + change < lower) | (values + change > upper))
        if not outside.any():
            break
        change[outside] = np.clip(values + change, lower, upper)[outside] - values[outside]
        free &= ~outside
    for greater, smaller in ordered:
        change[greater] += change[smaller]
    return change


def _least_squares(columns: Array, target: Array) -> Array:
    if columns.shape[1] == 0:
        return np.zeros(0)
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0] = 1.0
    gram = (columns / scale).T @ (columns / scale)
    moment = (columns / scale).T @ target
    return np.asarray(np.linalg.lstsq(gram, moment, rcond=1e-10)[0] / scale)
