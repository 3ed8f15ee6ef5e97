"""Step 5 of the chain: the parameters of an explanation, with honest intervals.

An explanation is named and fitted from the rows in which every joint surely moves in one direction: there the
sign of the velocity, and so the friction, is known. Usual identification fits all rows in which the joints
move, quick reversals included. Both are computed. Where they differ by more than their statistical errors the
model is not the whole truth near reversals, so an interval spans what both views allow.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.noise_bias import without_noise_bias
from missing_physics.diagnosis.preparation.setup import InertialBasis, nominal_terms
from missing_physics.diagnosis.preparation.split import CREDIBLE_CHANGE
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.written.words import inertial_unit
from missing_physics.results.result import Estimate, ParameterChange
from robot_model import Robot

__all__ = ["PRIOR_95", "FinalModel"]

#: Hidden modes are simulated to first order in the deflection: against full simulations of links that bend by
#: some hundredths of their length that moves a period by up to this part of it.
FIRST_ORDER = 3e-3
#: Half a 95 % interval of a normal distribution in standard deviations.
PRIOR_95 = 1.96


class FinalModel:
    """The final fit of an explanation.

    Attributes:
        explanation: the fit whose values are reported.
        other: the same terms in the other view, which widens the intervals.
    """

    def __init__(
        self, robot: Robot, basis: InertialBasis, named: Explanation, *, nuisance: bool, usual: bool = False
    ) -> None:
        """Fit `named` in both views; `usual` reports the view with reversals instead of that without."""
        self.robot = robot
        self.basis = basis
        self._nuisance = nuisance
        view = replace(named.view, reversals=True)
        whole = explain(named.problem, view, named.terms, nuisance=nuisance)
        self._fitted = (whole, named) if usual else (named, whole)
        self.explanation, self.other = self._fitted if usual else map(without_noise_bias, self._fitted)

    def intervals(self, term: Term) -> dict[str, tuple[float, float]]:
        """95 % intervals of a term's numbers that span both views; what is not told stays where it is."""
        one, two = (
            _no_narrower(fit.intervals(own), before.intervals(own))
            for fit, before in zip((self.explanation, self.other), self._fitted)
            for own in [next(t for t in fit.terms if t.key == term.key)]
        )
        return {name: _span(one[name], two[name]) for name in one}

    def estimates(self, term: Term) -> dict[str, Estimate]:
        """Parameters of a term with intervals that span both views."""
        fitted = next(t for t in self.explanation.terms if t.key == term.key)
        spans = self.intervals(term)
        for elsewhere in self._elsewhere(fitted):
            spans = {name: _span(spans[name], found) for name, found in elsewhere.items()}
        return {
            p.name: Estimate(fitted.parameters[p.name], spans[p.name], fitted.unit(self.robot, p))
            for p in fitted.estimated
            if p not in fitted.beside
        }

    def _elsewhere(self, term: Term) -> Iterator[dict[str, tuple[float, float]]]:
        """Intervals of a term's numbers with each that the data do not tell a typical size off its start.

        As of a payload's mass where its place is not told: a number that depends on such a one is known no
        better than that. Numbers that runs tell go there by as much as a regression moves them.
        """
        for parameter in term.effect.estimated:
            if parameter.name not in term.unseen or parameter.absent is not None:
                continue
            tied = {name for pair in term.effect.ordered for name in pair}
            if parameter.name in tied:
                continue
            here = term.parameters[parameter.name]
            low, high = term.narrowed.get(parameter.name, (parameter.lower, parameter.upper))
            for step in (-parameter.typical, parameter.typical):
                there = float(np.clip(here + step, low, high))
                moved = replace(term, parameters={**term.parameters, parameter.name: there})
                if not term.held:
                    fit, own = self._with(moved)
                    yield fit.intervals(own)
                    continue
                (_, there_told), (_, here_told) = self._with(moved.released), self._with(term.released)
                shifts = {n: there_told.parameters[n] - here_told.parameters[n] for n in term.free}
                told = self.explanation.intervals(term)
                yield {n: (low + shifts[n], high + shifts[n]) for n, (low, high) in told.items()}

    def _with(self, term: Term) -> tuple[Explanation, Term]:
        """The fit with a term in the place of the same one with other numbers, and this term in it."""
        terms = [term if t.key == term.key else t for t in self.explanation.terms]
        fit = explain(self.explanation.problem, self.explanation.view, terms, nuisance=self._nuisance)
        return fit, next(t for t in fit.terms if t.key == term.key)

    def inertial_parameters(self) -> tuple[ParameterChange, ...]:
        """Inertial numbers that the data determine one by one."""
        told = self.explanation.view.told
        count = self.explanation.nuisance.size if told is None else told.values.size
        if not count:
            return ()
        model = self.explanation.problem.segments[0].dynamics.model
        changes = []
        for index, name in enumerate(self.basis.names):
            if not self.basis.identifiable(index, count):
                continue
            nominal = float(model.inertial[self.basis.columns[index]])
            direction = self.basis.first(count)[index]
            low, high = _span(
                self.explanation.nuisance_interval(direction), self.other.nuisance_interval(direction)
            )
            centre = nominal + self.explanation.combination(direction)
            changes.append(
                ParameterChange(
                    name,
                    inertial_unit(name),
                    nominal,
                    centre,
                    (nominal + low, nominal + high),
                    prior95=_credible(nominal, self.basis.scale[index]),
                )
            )
        return tuple(changes)

    def nominal_parameters(self, wrong: Collection[tuple[str, str]]) -> tuple[ParameterChange, ...]:
        """Everything of the nominal robot that was re-estimated; `wrong` are the terms that are findings."""
        changes = list(self.inertial_parameters())
        given = {t.key: t for t in nominal_terms(self.robot)}
        for term in self.explanation.terms:
            if not term.nominal or term.frozen:
                continue
            note = "a finding" if term.key in wrong else ""
            for name, estimate in self.estimates(term).items():
                before = given[term.key].parameters[name]
                changes.append(
                    ParameterChange(
                        f"{term.label}.{name}",
                        estimate.unit,
                        before,
                        estimate.value,
                        estimate.ci95,
                        note,
                        _credible(before, abs(before) or term.effect.parameter(name).typical),
                    )
                )
        return tuple(changes)


def _credible(nominal: float, size: float) -> tuple[float, float]:
    """95 % interval of a number before recordings are seen, from its typical size."""
    half = PRIOR_95 * CREDIBLE_CHANGE * size
    return nominal - half, nominal + half


def _no_narrower(
    found: dict[str, tuple[float, float]], before: dict[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Intervals about their centres, at least as wide as those of before, whose centres they hold."""
    kept = {}
    for name, (low, high) in found.items():
        half, centre = max(high - low, before[name][1] - before[name][0]) / 2, sum(before[name]) / 2
        middle = (low + high) / 2
        half += FIRST_ORDER * abs(middle) if name == "period" else 0.0
        kept[name] = min(middle - half, centre), max(middle + half, centre)
    return kept


def _span(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    return min(one[0], other[0]), max(one[1], other[1])
