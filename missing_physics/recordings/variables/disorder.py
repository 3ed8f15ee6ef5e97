"""Sample instants that do not increase: the rows that cause it, and how to correct them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["disorder"]

Array = NDArray[np.float64]

#: A row is a separate sample if no other instant is nearer than this fraction of the usual step.
ROOM = 0.5


def disorder(time: Array, *, first_row: int, shortest: int) -> str:
    """The end of a sentence: where instants do not increase, and what to do about it.

    Args:
        time: instants that do not all increase [s], shape (N,).
        first_row: number of the first row in the file.
        shortest: fewest samples of a record.
    """
    wrong = np.flatnonzero(np.diff(time) <= 0)
    if np.all(np.diff(time)[wrong] == 0):
        return f"{_where(time, wrong, first_row)}; {SPREAD}"
    misfits = _misfits(time)
    blocks = np.split(misfits, np.flatnonzero(np.diff(misfits) > 1) + 1)
    if np.all(np.diff(time)[wrong] < 0) and min(len(block) for block in blocks) >= shortest:
        return (
            f"{_where(time, wrong, first_row)}; if the file holds {wrong.size + 1} records one after "
            "another, write record = 1 (or another number) into the map, else sort the rows"
        )
    if np.mean(_have_places(time, misfits)) > 0.5:
        return f"{_where(time, wrong, first_row)}; the rows are out of order: sort them by time"
    return _damaged(time, misfits, first_row)


#: For rows with one and the same instant.
SPREAD = (
    "this happens where the clock is coarser than the sampling: write "
    'equal_stamps = "spread" into the map under [time], or remove doubled rows'
)


def _where(time: Array, wrong: NDArray[np.intp], first_row: int) -> str:
    i = int(wrong[0]) + 1
    kind = "repeats" if time[i] == time[i - 1] else "goes back"
    rows = "one such row" if wrong.size == 1 else f"{wrong.size} such rows"
    return f"time {kind} in row {i + first_row} ({float(time[i - 1])} s, then {float(time[i])} s; {rows})"


def _damaged(time: Array, misfits: NDArray[np.intp], first_row: int) -> str:
    """Message on single damaged instants; an interrupted clock would leave complete records instead."""
    rest = np.setdiff1d(np.arange(time.size), misfits)
    row = int(misfits[0])
    after = int(np.searchsorted(rest, row))
    near = [f"{float(time[k])} s" for k in rest[max(after - 1, 0) : after + 1]]
    more = f" ({misfits.size} such rows)" if misfits.size > 1 else ""
    rows = "these rows" if misfits.size > 1 else "it"
    return (
        f"row {row + first_row} has the time {float(time[row])} s where the rows next to it have "
        f"{' and '.join(near)}{more}, so it is damaged or not a sample; remove {rows}"
    )


def _misfits(time: Array) -> NDArray[np.intp]:
    """The fewest rows without which the rest increases (complement of a longest increasing subsequence)."""
    tops: list[float] = []  # smallest last instant of a rising subsequence of each length
    rows: list[int] = []
    before = np.full(time.size, -1)
    for row, instant in enumerate(time.tolist()):
        length = bisect_left(tops, instant)
        before[row] = rows[length - 1] if length else -1
        tops[length : length + 1] = [instant]
        rows[length : length + 1] = [row]
    kept = _traced(before, rows[-1])
    return np.setdiff1d(np.arange(time.size), kept)


def _traced(before: NDArray[np.int_], last: int) -> Sequence[int]:
    kept = []
    while last >= 0:
        kept.append(last)
        last = int(before[last])
    return kept


def _have_places(time: Array, misfits: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether each misfit would be a separate sample if the rows were sorted, shape (M,)."""
    every = np.sort(time)
    steps = np.diff(every)
    room = ROOM * float(np.median(steps))
    apart = np.minimum(np.append(np.inf, steps), np.append(steps, np.inf))[
        np.searchsorted(every, time[misfits])
    ]
    rest = np.delete(time, misfits)
    inside = (time[misfits] > rest[0]) & (time[misfits] < rest[-1])
    return np.asarray(inside & (apart > room))
