"""Selection of the part of a recording that is used, and the message about the rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = ["LONGEST_GAP", "longest_stretch", "missing_words", "stretch_words"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: A gap of more than this many of a channel's sampling times cuts the recording.
LONGEST_GAP = 10.0
#: Gaps that a sentence describes, longest first.
DESCRIBED = 2


def longest_stretch(time: Array) -> NDArray[np.intp]:
    """Indices of the longest run of instants without a gap, shape (K,)."""
    steps = np.diff(time)
    cuts = np.flatnonzero(steps > LONGEST_GAP * float(np.median(steps))) + 1
    return max(np.split(np.arange(time.size), cuts), key=len)


def stretch_words(time: Array, present: Mapping[str, Flags], used: Array) -> str:
    """Which part of a recording is used and why not the rest; empty if hardly anything is unused.

    Args:
        time: instants of the recording [s], shape (N,).
        present: mask of the values of each required channel, shape (N,).
        used: the instants that are used [s], shape (K,).
    """
    usual = LONGEST_GAP * float(np.median(np.diff(used)))
    if (time[-1] - time[0]) - (used[-1] - used[0]) <= usual:
        return ""
    held = time[np.all([*present.values()], axis=0)]
    ends = np.concatenate([[time[0]], held, [time[-1]]])
    gaps = [(a, b) for a, b in pairwise(ends.tolist()) if b - a > usual]
    gaps.sort(key=lambda gap: gap[0] - gap[1])
    causes = [*_causes(time, present, gaps[:DESCRIBED])]
    if (more := len(gaps) - DESCRIBED) > 0:
        causes.append(f"{more} more gap{'s' if more > 1 else ''}")
    return (
        f"only {used.size} of {time.size} samples are used, those from {used[0]:.6g} to {used[-1]:.6g} s: "
        f"{', and '.join(causes)}; a gap of more than {LONGEST_GAP:g} samples cuts a recording, and its "
        "longest part is taken"
    )


def _causes(time: Array, present: Mapping[str, Flags], gaps: list[tuple[float, float]]) -> Iterator[str]:
    for start, stop in gaps:
        inside = (time > start) & (time < stop)
        lacking = [channel for channel, good in present.items() if not good[inside].all()]
        if lacking:
            names = f"{', '.join(lacking[:-1])} and {lacking[-1]}" if len(lacking) > 1 else lacking[0]
            have = "have no numbers" if len(lacking) > 1 else "has no number"
            yield f"{names} {have} between {start:.6g} and {stop:.6g} s"
        else:
            yield f"no sample was recorded between {start:.6g} and {stop:.6g} s"


def missing_words(present: Mapping[str, Flags]) -> str:
    """The channel with the fewest values and their number, in brackets; empty if none is missing."""
    channel, good = min(present.items(), key=lambda item: np.count_nonzero(item[1]))
    if good.all():
        return ""
    return f" ({channel} has a number in {np.count_nonzero(good)} of {good.size} samples)"
