"""Step 5 of the chain: the parameters of an explanation, with honest intervals.

An explanation is named and fitted from the rows in which every joint surely moves in one direction: there the
sign of the velocity, and so the friction, is known. Usual identification fits all rows in which the joints
move, quick reversals included. Both are computed. Where they differ by more than their statistical errors the
model is not the whole truth near reversals, so an interval spans what both views allow.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from missing_physics.diagnosis.explanation import Explanation, explain
from missing_physics.diagnosis.result import Estimate, ParameterChange
from missing_physics.diagnosis.setup import InertialBasis, nominal_terms
from missing_physics.diagnosis.terms import Term
from missing_physics.diagnosis.words import inertial_unit
from robot_model import Robot

__all__ = ["FinalModel"]


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
        view = replace(named.view, reversals=True)
        whole = explain(named.problem, view, named.terms, nuisance=nuisance)
        self.explanation, self.other = (whole, named) if usual else (named, whole)

    def estimates(self, term: Term) -> dict[str, Estimate]:
        """Parameters of a term with intervals that span both views."""
        fitted, again = (
            next(t for t in fit.terms if t.key == term.key) for fit in (self.explanation, self.other)
        )
        one, two = self.explanation.intervals(fitted), self.other.intervals(again)
        return {
            p.name: Estimate(
                fitted.parameters[p.name], _span(one[p.name], two[p.name]), fitted.unit(self.robot, p)
            )
            for p in fitted.estimated
            if p not in fitted.beside
        }

    def inertial_parameters(self) -> tuple[ParameterChange, ...]:
        """Inertial numbers that the data determine one by one."""
        if not self.explanation.nuisance.size:
            return ()
        model = self.explanation.problem.segments[0].dynamics.model
        changes = []
        for index, name in enumerate(self.basis.names):
            if not self.basis.identifiable(index):
                continue
            nominal = float(model.inertial[self.basis.columns[index]])
            direction = self.basis.directions[index]
            low, high = _span(
                self.explanation.nuisance_interval(direction), self.other.nuisance_interval(direction)
            )
            centre = nominal + float(direction @ self.explanation.nuisance)
            changes.append(
                ParameterChange(name, inertial_unit(name), nominal, centre, (nominal + low, nominal + high))
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
                changes.append(
                    ParameterChange(
                        f"{term.label}.{name}",
                        estimate.unit,
                        given[term.key].parameters[name],
                        estimate.value,
                        estimate.ci95,
                        note,
                    )
                )
        return tuple(changes)


def _span(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    return min(one[0], other[0]), max(one[1], other[1])
