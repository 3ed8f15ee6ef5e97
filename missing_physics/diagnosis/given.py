"""Whether recordings and options can be used at all."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from robot_model import InputError, Recording

__all__ = ["require_usable"]


def require_usable(every: Sequence[Recording], fitted: int, cutoff: float | None) -> None:
    """Raises `InputError` for a cut-off that cannot be, or a recording that is given twice.

    Args:
        every: recordings, those that are fitted first.
        fitted: how many these are.
        cutoff: of the low-pass filter [Hz], None where it follows from the data.
    """
    slowest = min(every, key=lambda recording: recording.sample_rate)
    if cutoff is not None and not 0.0 < cutoff < slowest.sample_rate / 2:
        raise InputError(
            f"the cut-off of {cutoff:g} Hz is not between 0 and {slowest.sample_rate / 2:.6g} Hz, half the "
            f"sampling rate of {slowest.source or 'the recording'}; give another one, or leave it out."
        )
    for (i, one), (j, other) in combinations(enumerate(every), 2):
        if not one.same_values(other):
            continue
        name = other.source or f"recording {j + 1}"
        if i < fitted <= j:
            raise InputError(
                f"{name} is given with --validate and holds what is fitted (recording {i + 1}), so it would "
                "prove nothing; give another one, or none, and a quarter of each recording is held out."
            )
        raise InputError(f"{name} holds the same as recording {i + 1}; give each recording once.")
