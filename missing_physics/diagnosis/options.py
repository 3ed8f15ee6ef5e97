"""Choices of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Options"]


@dataclass(frozen=True)
class Options:
    """Choices of a diagnosis.

    Attributes:
        cutoff: of the low-pass filter [Hz]; found from the data when None.
        seed: of everything that involves chance.
        experiments: whether separating motions are designed.
        simulation: whether what was found is run and refitted in simulation, where that is possible.
        as_recorded: whether channels are believed although they contradict each other.
    """

    cutoff: float | None = None
    seed: int = 0
    experiments: bool = True
    simulation: bool = True
    as_recorded: bool = False
