"""Options of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Options"]


@dataclass(frozen=True)
class Options:
    """Options of a diagnosis.

    Attributes:
        cutoff: of the low-pass filter [Hz]; found from the data when None.
        seed: of all random numbers.
        experiments: whether to design experiments that separate rival hypotheses.
        as_recorded: whether channels are used even if they contradict each other.
    """

    cutoff: float | None = None
    seed: int = 0
    experiments: bool = True
    as_recorded: bool = False
