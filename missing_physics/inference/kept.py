"""Cache of columns, and the steps of the finite differences by which they are computed."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, Protocol, TypeVar

from missing_physics.hypotheses import Term
from reference_model.effects.base import Parameter

__all__ = ["STEP", "Kept", "step_of"]

#: Step of a finite difference, as a fraction of the parameter's value or of a typical one: small compared
#: with the scale on which columns change, even at a resonance, and far above rounding.
STEP = 1e-3
#: Most floating-point numbers that are cached for all recordings: 256 MB.
MOST = 32_000_000


class _Sized(Protocol):
    @property
    def size(self) -> int: ...


V = TypeVar("V", bound=_Sized)


class Kept(Generic[V]):
    """Cache of the arrays used last; those not used for longest are dropped beyond `MOST` numbers."""

    def __init__(self) -> None:
        self._values: dict[Hashable, V] = {}
        self._size = 0

    def get(self, key: Hashable) -> V | None:
        """The cached value of a key, which counts as used now, or None."""
        if key not in self._values:
            return None
        found = self._values[key] = self._values.pop(key)
        return found

    def keep(self, key: Hashable, value: V) -> V:
        """Cache a value, replacing an earlier one of the same key."""
        before = self._values.pop(key, None)
        self._size += value.size - (0 if before is None else before.size)
        self._values[key] = value
        while self._size > MOST and len(self._values) > 1:
            self._size -= self._values.pop(next(iter(self._values))).size
        return value


def step_of(term: Term, p: Parameter) -> float:
    """Step of a finite difference in a parameter of a term, directed away from its upper bound."""
    value = term.parameters[p.name]
    size = STEP * max(abs(value), p.typical)
    ends = {name: high for name, _, high in term.limits}
    return -size if value + size > ends.get(p.name, p.upper) else size
