"""Sampled references as tables that a robot can be run along."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.ndimage import median_filter

from robot_model import Hold, Recording, Robot, Table

__all__ = ["REPRODUCED", "table_of", "tables"]

Array = NDArray[np.float64]

#: The table of a reference reproduces every sample to this part of its range.
REPRODUCED = 1e-10
#: Instants of that table are at most so many samples apart.
WIDEST = 64
#: A quintic spline is worth while where it takes less than this part of a cubic one's instants.
WORTH_WHILE = 1.0 / 3.0
#: Its accelerations are those of a cubic one through all samples to this part of their range, or as well as
#: samples tell them: to this part of what jerk usually changes by from one to the next, times their time.
ACCELERATIONS, KNOWN = 2e-5, 1.0 / 6.0
#: Samples that count as around, how often the time between two may be halved for it, and samples at either
#: end where nothing tells accelerations.
AROUND, HALVED, END = 17, 5, 3


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
    """A spline through few instants that gives all samples.

    Of degree 5 where the reference is smooth, since a multistep method slows down at every knot of a cubic
    one; of degree 3 where that takes few knots as well.

    Args:
        joint: that moves so.
        time: four instants or more, rising [s], shape (samples,).
        values: positions [rad or m], shape (samples,).
    """
    chosen = _knots(time, values, 3)
    times, positions, degree = time[chosen], values[chosen], 3
    fewer = _quintic(time, values) if time.size > 5 else None
    if fewer is not None and fewer[0].size < WORTH_WHILE * chosen.size:
        (times, positions), degree = fewer, 5
    return Table(
        joint=joint, times=tuple(times), positions=tuple(positions), degree=cast(Literal[3, 5], degree)
    )


def _quintic(time: Array, values: Array) -> tuple[Array, Array] | None:
    """Instants of a quintic spline, and its values there; None where it does not give every sample.

    At a kink of the acceleration, as where a ramp ends, it rings by a tenth of the jerk's jump times the time
    between two instants, which accelerometers and torques under a stiff controller show. So there these come
    closer together than samples are, on a cubic spline through all samples, which has a kink at each.
    """
    cubic, count = make_interp_spline(time, values, k=3), np.arange(time.size)
    jumps = np.abs(np.diff(cubic.derivative(3)(0.5 * (time[1:] + time[:-1]))))
    usual = KNOWN * median_filter(jumps * np.diff(time)[1:], AROUND, mode="nearest")
    allowed = np.maximum(usual, ACCELERATIONS * np.ptp(cubic.derivative(2)(time)))
    places = _knots(time, values, 5).astype(float)  # in samples
    while places.size < time.size:
        knots = np.interp(places, count, time)
        found = cubic(knots)
        spline = make_interp_spline(knots, found, k=5)
        gaps = np.diff(places)
        between = np.interp(places[:-1, None] + gaps[:, None] * np.array([0.25, 0.5, 0.75]), count, time)
        off = np.abs(spline.derivative(2)(between) - cubic.derivative(2)(between)).max(axis=1)
        far = (off > np.interp(between[:, 1], time[1:-1], allowed)) & (gaps > 0.5**HALVED)
        far &= (between[:, 1] > time[END]) & (between[:, 1] < time[-1 - END])
        if not far.any():
            near = np.abs(spline(time) - values).max() <= REPRODUCED * np.ptp(values)
            return (knots, found) if near else None
        middle = places[:-1] + 0.5 * gaps
        places = np.union1d(places, np.where(gaps > 1.0, np.floor(middle), middle)[far])
    return None


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
