"""The standard model with effects, and with some of its numbers held or taken from the robot file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from missing_physics.hypotheses.term import Term

__all__ = ["BODIES", "TIMING", "Hypothesis"]

#: In `Hypothesis.filed`: masses, centres and inertias of all bodies.
BODIES = "bodies"
#: The delay of all recorded torques behind the motion [s]; with a joint's name before it, how much later than
#: the others that joint's is.
TIMING = "timing"


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects beyond the standard model.

    Attributes:
        terms: the effects, no two of the same kind at the same place.
        held: numbers of the standard model that are not estimated, and the values that they keep.
        filed: numbers of the standard model that are about as the robot file has them, by name; `BODIES`.
    """

    terms: tuple[Term, ...] = ()
    held: tuple[tuple[str, float], ...] = ()
    filed: frozenset[str] = frozenset()

    @property
    def key(self) -> tuple[object, ...]:
        """The same for hypotheses that differ in the values of their terms only."""
        terms = sorted((*term.key, -1 if term.run is None else term.run) for term in self.terms)
        return tuple(terms), tuple(sorted(self.held)), self.filed

    def without(self, term: Term) -> Hypothesis:
        """Less one term; a number of the standard model that it had taken the place of is free again."""
        left = tuple(other for other in self.terms if other.key != term.key)
        taken = {f"{term.at}.coulomb"} if term.effect.family else set()
        taken |= {f"{term.at}.offset"} if "torque_offset" in term.effect.contains else set()
        held = tuple((name, value) for name, value in self.held if name not in taken)
        return replace(self, terms=left, held=held)

    def holding(self, values: Mapping[str, float]) -> Hypothesis:
        """With further numbers of the standard model held."""
        return replace(self, held=tuple({**dict(self.held), **values}.items()))

    def filing(self, *names: str) -> Hypothesis:
        """With further numbers as the robot file has them."""
        return replace(self, filed=self.filed | set(names))
