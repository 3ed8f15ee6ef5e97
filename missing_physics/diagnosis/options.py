"""Choices of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Options"]


@dataclass(frozen=True)
class Options:
    """Choices of a diagnosis.

    Attributes:
        cutoff: of the low-pass filter [Hz]; found from the data when None.
        seed: of all random numbers.
        experiments: whether separating motions are designed.
        as_recorded: whether channels are used although they contradict each other.
    """

    cutoff: float | None = None
    seed: int = 0
    experiments: bool = True
    as_recorded: bool = False
