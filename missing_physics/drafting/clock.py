"""The log's clock: the column of time stamps and its unit, or the sample rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.drafting.columns import Column
from missing_physics.drafting.names import is_time, tokens, unit_of_time

__all__ = ["Clock", "clock_of"]

#: Range of sample times of robot logs [s]; others indicate another unit.
SHORTEST, LONGEST = 5e-6, 0.2
#: Initial guess of an unknown rate [Hz].
DEFAULT_RATE = 1000.0
#: Units by their size [s].
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: Largest fraction of rows with equal time stamps for which a clock counts as coarse.
COARSE = 0.95

#: Maximum number of alternative columns that are listed.
SHOWN = 4

Array = NDArray[np.float64]


@dataclass
class Clock:
    """The table ``[time]`` of a map.

    Attributes:
        table: its keys.
        seconds: time stamps [s], shape (N,); for an unknown rate those of the initial guess.
        column: the column that contains them.
        known: whether the unit or rate is known.
        reasons, questions: reasons for the guesses, and open questions.
    """

    table: dict[str, Any]
    seconds: Array = field(repr=False)
    column: Column | None = None
    known: bool = True
    reasons: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)


def clock_of(columns: Sequence[Column]) -> Clock:
    """The most probable clock."""
    rising = [column for column in columns if _rises(column)]
    named = sorted((c for c in rising if is_time(c.source) or c.instants), key=_time_rank)
    if not named:
        return _unknown_rate(columns[0].values.size)
    column = named[0]
    clock = _stamps(column) if column.instants else _numbers(column)
    others = [other for other in named[1:] if not np.array_equal(other.values, column.values)]
    if others:
        names = ", ".join(f"'{other.label}'" for other in others[:SHOWN])
        clock.reasons.append(f"{names} {'increases' if len(others) == 1 else 'increase'} as well")
    return clock


def _rises(column: Column) -> bool:
    steps = np.diff(column.values)
    return bool(
        np.isfinite(steps).all() and steps.min() >= 0 and np.mean(steps == 0) < COARSE and steps.max() > 0
    )


def _time_rank(column: Column) -> tuple[bool, int]:
    """Sort key: columns declared as time stamps first, then short names."""
    return not column.instants, len(tokens(column.source))


def _unknown_rate(count: int) -> Clock:
    return Clock(
        table={"rate": DEFAULT_RATE},
        seconds=np.arange(count) / DEFAULT_RATE,
        known=False,
        questions=["no column increases like time: what is the sample rate?"],
    )


def _stamps(column: Column) -> Clock:
    seconds = 1e-9 * (column.values - column.values[0])
    table = {"source": column.source, **column.place}
    return _spread(Clock(table, seconds, column, reasons=[f"'{column.label}' holds dates and times"]))


def _numbers(column: Column) -> Clock:
    step = float(np.median(np.diff(column.values)[np.diff(column.values) > 0]))
    table: dict[str, Any] = {"source": column.source, **column.place}
    unit, named = unit_of_time(column.source), True
    if not unit and np.ptp(np.diff(column.values)) == 0 and step == 1.0:
        return Clock(
            table={"rate": DEFAULT_RATE},
            seconds=np.arange(column.values.size) / DEFAULT_RATE,
            column=column,
            known=False,
            reasons=[f"'{column.label}' counts samples or milliseconds"],
            questions=["what is the sample rate?"],
        )
    if not unit:
        fitting = [name for name, size in UNITS.items() if SHORTEST <= step * size <= LONGEST]
        unit, named = (fitting or ["s"])[0], False
    if unit != "s":
        table["unit"] = unit
    if abs(column.values[0]) > 1e6 * step:
        table["start_at_zero"] = True
    size = UNITS.get(unit, 60.0)
    seconds = size * (column.values - column.values[0])
    rate = f"its steps of {step:g} {unit} are {1 / (step * size):.4g} samples per second"
    clock = Clock(table, seconds, column, known=named or unit == "s")
    clock.reasons.append(f"'{column.label}' has a name for time and increases; {rate}")
    if named:
        clock.reasons.append(f"its unit {unit} is in its name")
    elif unit != "s":
        clock.questions.append(f"is its unit {unit}? It is guessed from the size of its steps alone.")
    return _spread(clock)


def _spread(clock: Clock) -> Clock:
    equal = float(np.mean(np.diff(clock.seconds) == 0))
    if equal:
        clock.table["equal_stamps"] = "spread"
        clock.questions.append(
            f"{math.ceil(100 * equal)} % of the rows have the same time stamp as the row before; are these "
            "separate samples, stamped by a coarse clock?"
        )
    return clock
