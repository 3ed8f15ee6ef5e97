"""One effect at one place with its numbers."""

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
    """

    effect: Effect
    at: str
    values: tuple[float, ...]

    @classmethod
    def of(cls, effect: Effect, at: str, values: Mapping[str, float]) -> Term:
        """With defaults for what is not given."""
        given = {**effect.defaults(), **values}
        return cls(effect, at, tuple(float(given[p.name]) for p in effect.parameters))

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

    @property
    def joint(self) -> str:
        """The joint that it sits at, or the part of the place before its channel."""
        return self.at.split(".")[0]

    def moved(self, values: Mapping[str, float]) -> Term:
        """With other values of some parameters, kept inside of the catalogue's bounds."""
        new = {**self.parameters, **values}
        bounded = [min(max(new[p.name], p.lower), p.upper) for p in self.effect.parameters]
        return Term(self.effect, self.at, tuple(bounded))
