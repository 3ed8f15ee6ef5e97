"""Sampled references as tables that a robot can be run along."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from robot_model import Hold, Recording, Robot, Table

__all__ = ["REPRODUCED", "table_of", "tables"]

Array = NDArray[np.float64]

#: The table of a reference reproduces every sample to this part of its range. Controllers know its
#: accelerations. A motion with kinks in them left, under computed torque, 1.10 times the noise's square with
#: a quintic spline of this number, 1.26 with ten times and 1.35 with a hundred times as much.
REPRODUCED = 1e-10
#: A quintic spline is worth while where it takes less than this part of a cubic one's instants: at a kink of
#: the acceleration, which a cubic one has at every knot, it rings.
WORTH_RINGING = 1.0 / 3.0
#: Instants of that table are at most so many samples apart.
WIDEST = 64


def tables(robot: Robot, recording: Recording) -> Iterator[Table | Hold]:
    """The recorded references, one per moving joint; times count from the recording's first instant."""
    time = recording.time - recording.time[0]
    for joint in robot.moving_joints:
        name = f"{joint.name}.reference_position"
        if name not in recording:
            yield Hold(joint=joint.name)
            continue
        values = recording[name]
        if np.ptp(values) == 0.0 and values[0] == joint.initial_position:
            yield Hold(joint=joint.name)
            continue
        yield table_of(joint.name, time, values)


def table_of(joint: str, time: Array, values: Array) -> Table:
    """A spline through the fewest samples that gives all others.

    Of degree 5 where the reference is smooth, since a multistep method slows down at every knot of a cubic
    one; of degree 3 where that takes few knots as well.

    Args:
        joint: that moves so.
        time: four instants or more, rising [s], shape (samples,).
        values: positions [rad or m], shape (samples,).
    """
    chosen = _knots(time, values, 3)
    degree: Literal[3, 5] = 3
    if time.size > 5:
        fewer = _knots(time, values, 5)
        if fewer.size < WORTH_RINGING * chosen.size:
            chosen, degree = fewer, 5
    return Table(joint=joint, times=tuple(time[chosen]), positions=tuple(values[chosen]), degree=degree)


def _knots(time: Array, values: Array, degree: int) -> NDArray[np.int_]:
    """Samples whose spline gives all others; close together only where that takes it."""
    chosen = np.zeros(time.size, dtype=bool)
    chosen[:: min(WIDEST, (time.size - 1) // degree)] = chosen[-1] = True
    within = REPRODUCED * np.ptp(values)
    while True:
        knots = np.flatnonzero(chosen)
        spline = make_interp_spline(time[knots], values[knots], k=degree)
        off = np.flatnonzero(np.abs(spline(time) - values) > within)
        after = np.unique(np.searchsorted(knots, off))
        between = (knots[after - 1] + knots[after]) // 2
        if chosen[between].all():
            return knots
        chosen[between] = True
