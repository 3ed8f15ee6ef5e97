"""The standard model with effects, and with some of its numbers held."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from missing_physics.hypotheses.term import Term

__all__ = ["Hypothesis"]


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects beyond the standard model.

    Attributes:
        terms: the effects, no two of the same kind at the same place.
        held: numbers of the standard model that are not estimated, and the values that they keep.
    """

    terms: tuple[Term, ...] = ()
    held: tuple[tuple[str, float], ...] = ()

    @property
    def key(self) -> tuple[object, ...]:
        """The same for hypotheses that differ in the values of their terms only."""
        return tuple(sorted(term.key for term in self.terms)), tuple(sorted(self.held))

    def without(self, term: Term) -> Hypothesis:
        """Less one term; a number of the standard model that it had taken the place of is free again."""
        left = tuple(other for other in self.terms if other.key != term.key)
        taken = {f"{term.at}.coulomb"} if term.effect.family else set()
        taken |= {f"{term.at}.offset"} if "torque_offset" in term.effect.contains else set()
        return Hypothesis(left, tuple((name, value) for name, value in self.held if name not in taken))

    def holding(self, values: Mapping[str, float]) -> Hypothesis:
        """With further numbers of the standard model held."""
        return Hypothesis(self.terms, tuple({**dict(self.held), **values}.items()))
