"""One effect at one place with its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from reference_model.effects.base import Effect, Parameter

__all__ = ["Term"]


@dataclass(frozen=True)
class Term:
    """An effect at a place.

    Attributes:
        effect: the catalogue entry.
        at: joint, link, `base` or channel.
        values: every parameter of the effect, in the order of the catalogue.
        run: number of the one recording in which it acts; None where it acts in all of them.
        limits: bounds narrower than the catalogue's, set by a recording's extent: name, lower, upper.
    """

    effect: Effect
    at: str
    values: tuple[float, ...]
    run: int | None = None
    limits: tuple[tuple[str, float, float], ...] = ()

    @classmethod
    def of(
        cls,
        effect: Effect,
        at: str,
        values: Mapping[str, float],
        *,
        run: int | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
    ) -> Term:
        """A term with the catalogue's defaults for values not given, within its bounds and narrower ones."""
        given = {**effect.defaults(), **values}
        bounds = {p.name: (p.lower, p.upper) for p in effect.parameters} | dict(limits or {})
        inside = {name: min(max(float(given[name]), low), high) for name, (low, high) in bounds.items()}
        for larger, smaller in effect.ordered:
            inside[larger] = max(inside[larger], inside[smaller])
        narrower = tuple((name, *pair) for name, pair in (limits or {}).items())
        return cls(effect, at, tuple(inside[p.name] for p in effect.parameters), run, narrower)

    @property
    def key(self) -> tuple[str, str]:
        """Effect id and place."""
        return self.effect.id, self.at

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values by name."""
        return MappingProxyType(dict(zip((p.name for p in self.effect.parameters), self.values)))

    @property
    def free(self) -> tuple[Parameter, ...]:
        """Parameters that are estimated."""
        return self.effect.estimated

    def moved(self, values: Mapping[str, float]) -> Term:
        """The term with other values of some parameters, within the catalogue's bounds."""
        limits = {name: (low, high) for name, low, high in self.limits}
        return Term.of(self.effect, self.at, {**self.parameters, **values}, run=self.run, limits=limits)
