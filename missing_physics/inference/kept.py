"""Columns kept from one use to the next, and the steps of the differences by which they are derived."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, Protocol, TypeVar

from missing_physics.hypotheses import Term
from reference_model.effects.base import Parameter

__all__ = ["STEP", "Kept", "step_of"]

#: Step of a difference in a parameter, as a part of its size or of a typical one: small beside the scale on
#: which columns change, a resonance among them, and far above rounding.
STEP = 1e-3
#: Most numbers that are kept of all recordings: 256 MB.
MOST = 32_000_000


class _Sized(Protocol):
    @property
    def size(self) -> int: ...


V = TypeVar("V", bound=_Sized)


class Kept(Generic[V]):
    """What was computed last, by what it was computed for; the oldest is dropped where it is too much."""

    def __init__(self) -> None:
        self._values: dict[Hashable, V] = {}
        self._size = 0

    def get(self, key: Hashable) -> V | None:
        """What was kept for a key, if it still is."""
        return self._values.get(key)

    def keep(self, key: Hashable, value: V) -> V:
        """Keep a value instead of what there was."""
        before = self._values.pop(key, None)
        self._size += value.size - (0 if before is None else before.size)
        self._values[key] = value
        while self._size > MOST and len(self._values) > 1:
            self._size -= self._values.pop(next(iter(self._values))).size
        return value


def step_of(term: Term, p: Parameter) -> float:
    """Of a difference in a parameter of a term, towards the inside of its range."""
    value = term.parameters[p.name]
    size = STEP * max(abs(value), p.typical)
    ends = {name: high for name, _, high in term.limits}
    return -size if value + size > ends.get(p.name, p.upper) else size
