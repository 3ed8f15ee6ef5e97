"""Cache of columns, and the steps of the finite differences by which they are computed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Term
from missing_physics.standard.normal import Places
from reference_model.effects.base import Parameter

__all__ = ["STEP", "Kept", "TermColumns", "step_of"]

Array = NDArray[np.float64]

#: Step of a finite difference, as a fraction of the parameter's value or of a typical one: small compared
#: with the scale on which columns change, even at a resonance, and far above rounding.
STEP = 1e-3
#: Most floating-point numbers that are cached for all recordings: 96 MB.
MOST = 12_000_000


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


class TermColumns(ABC):
    """Columns of terms that are computed one by one (`inference.data.Columns`), those used last cached."""

    def __init__(self) -> None:
        self._kept = Kept[Array]()

    @abstractmethod
    def _places(self, term: Term, run: int) -> Places:
        """Indices of the channels to which a term contributes, shape (a,)."""

    @abstractmethod
    def _made(self, term: Term, run: int) -> Array:
        """Columns of a term in these channels, shape (K, a, 1 + P)."""

    @abstractmethod
    def _shape(self, run: int) -> tuple[int, int]:
        """Number of rows of a recording, and of channels."""

    def prepare(self, terms: Sequence[Term], run: int) -> None:
        """Compute the columns of several terms."""
        for term in terms:
            self.acting(term, run)

    def acting(self, term: Term, run: int) -> tuple[Places, Array]:
        """The channels to which a term contributes, shape (a,), and its columns there, (K, a, 1 + P)."""
        key = (*term.key, term.values, term.along, tuple(p.name for p in term.free), run)
        found = self._kept.get(key)
        if found is None:
            found = self._kept.keep(key, self._made(term, run))
        return self._places(term, run), found

    def contributed(self, terms: Sequence[Term], run: int) -> Array:
        """Sum of the contributions of terms to the channels, shape (K, n)."""
        found = np.zeros(self._shape(run))
        for term in terms:
            places, values = self.acting(term, run)
            found[:, places] += values[:, :, 0]
        return found


def step_of(term: Term, p: Parameter) -> float:
    """Step of a finite difference in a parameter of a term, directed away from its upper bound."""
    value = term.parameters[p.name]
    size = STEP * max(abs(value), p.typical)
    ends = {name: high for name, _, high in term.limits}
    return -size if value + size > ends.get(p.name, p.upper) else size
