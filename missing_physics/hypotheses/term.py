"""One effect at one place, with its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

from reference_model.effects.base import Effect, Parameter
from reference_model.effects.catalogue import get_effect

__all__ = ["Term", "offsets_of"]


@dataclass(frozen=True)
class Term:
    """An effect at a place.

    Attributes:
        effect: the catalogue entry.
        at: joint, link, `base` or channel.
        values: every parameter of the effect, in the order of the catalogue.
        run: number of the only recording in which it is present; None if it is present in all.
        limits: bounds narrower than the catalogue's, set by a recording's extent: name, lower, upper.
        nominal: for a term of the robot file, its values there; empty for any other.
        freed: for a term of the robot file, the parameters that are estimated; the others are fixed.
        along: which of several signals drives it, such as an estimate of a torque; empty if there is one.
        further: log odds against it beyond `ODDS`, for values chosen from many [nats].
        located: parameters that locate the effect; a robot file must state them, here they are estimated.
        optional: parameters that the effect may lack; each costs the prior odds of another effect.
        in_rows: whether the file's term is already subtracted from the rows, so that only changes of its
            linear parameters contribute.
    """

    effect: Effect
    at: str
    values: tuple[float, ...]
    run: int | None = None
    limits: tuple[tuple[str, float, float], ...] = ()
    nominal: tuple[float, ...] = ()
    freed: frozenset[str] = frozenset()
    in_rows: bool = False
    along: str = ""
    further: float = 0.0
    optional: frozenset[str] = frozenset()
    located: frozenset[str] = frozenset()

    @classmethod
    def of(
        cls,
        effect: Effect,
        at: str,
        values: Mapping[str, float],
        *,
        run: int | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
        along: str = "",
        further: float = 0.0,
        optional: frozenset[str] = frozenset(),
        located: frozenset[str] = frozenset(),
    ) -> Term:
        """A term with the catalogue's defaults for missing values, clipped to its bounds and the limits."""
        given = {**effect.defaults(), **values}
        bounds = {p.name: (p.lower, p.upper) for p in effect.parameters} | dict(limits or {})
        inside = {name: min(max(float(given[name]), low), high) for name, (low, high) in bounds.items()}
        for larger, smaller in effect.ordered:
            inside[larger] = max(inside[larger], inside[smaller])
        narrower = tuple((name, *pair) for name, pair in (limits or {}).items())
        own = tuple(inside[p.name] for p in effect.parameters)
        return cls(
            effect, at, own, run, narrower, along=along, further=further, optional=optional, located=located
        )

    @classmethod
    def given(cls, effect: Effect, at: str, values: Mapping[str, float], *, in_rows: bool = False) -> Term:
        """A term of the robot file, with the file's values."""
        own = tuple(float(values[p.name]) for p in effect.parameters)
        return cls(effect, at, own, nominal=own, in_rows=in_rows)

    @property
    def key(self) -> tuple[str, str]:
        """Effect id and place."""
        return self.effect.id, self.at

    @property
    def joint(self) -> str:
        """Joint or body of the place; for a channel, the joint or body in its name."""
        return self.at.split(".")[0]

    @cached_property
    def parameters(self) -> Mapping[str, float]:
        """Values by name."""
        return MappingProxyType(dict(zip((p.name for p in self.effect.parameters), self.values)))

    @property
    def is_given(self) -> bool:
        """Whether the robot file has the term."""
        return bool(self.nominal)

    @cached_property
    def free(self) -> tuple[Parameter, ...]:
        """Parameters that are estimated; not those whose limits leave a single value."""
        held = {name for name, low, high in self.limits if low == high}
        if self.is_given:
            return tuple(p for p in self.effect.estimated if p.name in self.freed)
        every = (p for p in self.effect.parameters if p.estimated or p.name in self.located)
        return tuple(p for p in every if p.name not in held)

    def is_linear(self, p: Parameter) -> bool:
        """Whether the torques along a recorded motion are linear in a parameter."""
        return p.linear and not (self.is_compensated and p.name in self.effect.per_torque)

    @property
    def is_compensated(self) -> bool:
        """Whether it depends on the actuator's torque, which compensates for it."""
        return self.effect.uses_torque and not self.effect.cuts_torque and not self.in_rows

    def range_of(self, p: Parameter) -> tuple[float, float]:
        """Bounds of a parameter: those set by a recording's extent, else the catalogue's."""
        narrower = {name: (low, high) for name, low, high in self.limits}
        return narrower.get(p.name, (p.lower, p.upper))

    @cached_property
    def linear_values(self) -> tuple[float, ...]:
        """Values of the linear estimated parameters, 0 for non-linear ones.

        For a term already subtracted from the rows, their differences from the robot file.
        """
        values = self.parameters
        begin = {p.name: self.file_value(p.name) if self.in_rows else 0.0 for p in self.free}
        return tuple(values[p.name] - begin[p.name] if self.is_linear(p) else 0.0 for p in self.free)

    @cached_property
    def shape(self) -> tuple[object, ...]:
        """Key that is equal for terms that differ in their free linear parameters only."""
        free = {p.name for p in self.free}
        bent = (
            value
            for p, value in zip(self.effect.parameters, self.values)
            if p.name not in free or not self.is_linear(p)
        )
        return *self.key, self.run, tuple(bent), self.freed

    def file_value(self, name: str) -> float:
        """The robot file's value of a parameter of a term of the file."""
        return dict(zip((p.name for p in self.effect.parameters), self.nominal))[name]

    @property
    def added(self) -> tuple[str, ...]:
        """Names of the optional parameters that the term has."""
        return tuple(p.name for p in self.free if p.name in self.optional)

    def lacking(self, name: str) -> Term:
        """The term without an optional parameter."""
        absent = self.effect.parameter(name).absent
        assert absent is not None
        limits = (*(own for own in self.limits if own[0] != name), (name, absent, absent))
        return replace(self, limits=limits).moved({name: absent})

    def having(self, name: str) -> Term:
        """The term with an optional parameter that it lacks."""
        return replace(self, limits=tuple(own for own in self.limits if own[0] != name))

    def freeing(self, *names: str) -> Term:
        """A term of the robot file with further parameters estimated."""
        return replace(self, freed=self.freed | set(names))

    def restored(self, *names: str) -> Term:
        """A term of the robot file with the file's values for these parameters again; all without names."""
        freed = self.freed - set(names) if names else frozenset[str]()
        return replace(self, freed=freed).moved({})

    def moved(self, values: Mapping[str, float]) -> Term:
        """The term with other values of some parameters, clipped to the bounds."""
        limits = {name: (low, high) for name, low, high in self.limits}
        if not self.is_given:
            moved = Term.of(self.effect, self.at, {**self.parameters, **values}, limits=limits)
            return replace(self, values=moved.values)
        found = {**self.parameters, **values}
        for p in self.effect.parameters:
            inside = min(max(found[p.name], p.lower), p.upper)
            found[p.name] = inside if p.name in self.freed else self.file_value(p.name)
        for larger, smaller in self.effect.ordered:
            if larger in self.freed:
                found[larger] = max(found[larger], found[smaller])
            elif smaller in self.freed:
                found[smaller] = min(found[larger], found[smaller])
        return replace(self, values=tuple(found[p.name] for p in self.effect.parameters))


def offsets_of(effect: Effect) -> tuple[str, ...]:
    """Parameters of an effect that are a constant torque, like the offset of the standard model."""
    own = (names for other, names in effect.contains.items() if get_effect(other).standard == "offset")
    return tuple(name for names in own for name in names.values())
