"""The standard model with effects, and with some of its parameters held or taken from the robot file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from missing_physics.hypotheses.term import Term, offsets_of
from missing_physics.unnamed import UnknownForce

__all__ = ["BODIES", "TIMING", "Hypothesis"]

#: In `Hypothesis.from_file`: masses, centres and inertias of all bodies.
BODIES = "bodies"
#: Common delay of the recorded torques relative to the motion [s]; prefixed with a joint's name, the
#: additional delay of that joint.
TIMING = "timing"


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects beyond the standard model.

    Attributes:
        terms: the effects, including those of the robot file; no two of the same kind at the same place.
        held: parameters of the standard model that are not estimated, with their fixed values.
        from_file: names of the standard model parameters with a tight prior at the robot file's value;
            `BODIES` for all bodies.
        accuracy: relative accuracy of the bodies where they are taken from the file; `FILE` when None.
    """

    terms: tuple[Term, ...] = ()
    held: tuple[tuple[str, float], ...] = ()
    from_file: frozenset[str] = frozenset()
    accuracy: float | None = None

    @property
    def key(self) -> tuple[object, ...]:
        """Key that is equal for hypotheses differing only in the values of their terms."""
        terms = sorted(
            (*t.key, -1 if t.run is None else t.run, t.along, t.is_given, *sorted(t.freed), *t.added)
            for t in self.terms
        )
        return tuple(terms), tuple(sorted(self.held)), self.from_file, self.accuracy

    @property
    def freed(self) -> tuple[tuple[Term, str], ...]:
        """Terms of the robot file, each with the name of a parameter that may differ from the file."""
        return tuple((term, name) for term in self.terms for name in sorted(term.freed))

    @property
    def of_unnamed(self) -> frozenset[str]:
        """Parameters of the standard model that belong to a force without a name."""
        return frozenset(
            f"{term.at}.{name}"
            for term in self.terms
            if isinstance(term.effect, UnknownForce)
            for name in term.effect.within
        )

    def less(self, term: Term) -> Hypothesis:
        """The hypothesis without a term; a term of the robot file gets the file's values again."""
        return self.restoring(term) if term.freed and not term.in_rows else self.without(term)

    def restoring(self, term: Term, *names: str) -> Hypothesis:
        """The hypothesis with parameters of a term of the file restored to its values; all without names."""
        terms = (t.restored(*names) if t.key == term.key else t for t in self.terms)
        return replace(self, terms=tuple(t for t in terms if t.freed or not t.in_rows))

    def without(self, term: Term) -> Hypothesis:
        """The hypothesis without one term; standard model parameters that it replaced become free again."""
        left = tuple(other for other in self.terms if other.key != term.key)
        taken = {f"{term.at}.coulomb"} if term.effect.family else set()
        if offsets_of(term.effect) and not term.is_given:
            taken.add(f"{term.at}.offset")
        if term.effect.replaces_delay:
            taken.add(f"{term.at}.{TIMING}")
        held = tuple((name, value) for name, value in self.held if name not in taken)
        return replace(self, terms=left, held=held)

    def holding(self, values: Mapping[str, float]) -> Hypothesis:
        """The hypothesis with further parameters of the standard model held at fixed values."""
        return replace(self, held=tuple({**dict(self.held), **values}.items()))

    def taking_from_file(self, *names: str) -> Hypothesis:
        """The hypothesis with further parameters taken from the robot file."""
        return replace(self, from_file=self.from_file | set(names))
