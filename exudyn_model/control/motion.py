"""Reference motions: position, velocity and acceleration of every moving joint at an instant."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from math import cos, pi, sin

import numpy as np
from scipy.interpolate import PPoly, make_interp_spline

from robot_model import Cycloid, Hold, JointReference, MultiSine, Quintic, Robot, Table

__all__ = ["Motion", "motion_of", "motions"]

#: Time [s] to (position, velocity, acceleration).
Motion = Callable[[float], tuple[float, float, float]]

#: A profile over its own phase s in 0..1: value and two derivatives with respect to s.
Profile = Callable[[float], tuple[float, float, float]]


def motions(robot: Robot) -> list[Motion]:
    """One motion per moving joint, in the order of the file; joints without one hold."""
    given = {item.joint: item for item in robot.reference.joints} if robot.reference else {}
    return [
        motion_of(given.get(joint.name, Hold(joint=joint.name)), start=joint.initial_position)
        for joint in robot.moving_joints
    ]


def motion_of(reference: JointReference, *, start: float) -> Motion:
    """The motion described by `reference` from position `start` [rad or m]."""
    match reference:
        case Cycloid():
            return _rest_to_rest(_cycloid, reference, start)
        case Quintic():
            return _rest_to_rest(_quintic, reference, start)
        case MultiSine():
            return _multisine(reference, start)
        case Table():
            return _table(reference)
    return lambda time: (start, 0.0, 0.0)


def _cycloid(s: float) -> tuple[float, float, float]:
    w = 2 * pi
    return s - sin(w * s) / w, 1 - cos(w * s), w * sin(w * s)


def _quintic(s: float) -> tuple[float, float, float]:
    return (
        s**3 * (10 + s * (6 * s - 15)),
        30 * s**2 * (1 - s) ** 2,
        60 * s * (1 + s * (2 * s - 3)),
    )


def _rest_to_rest(profile: Profile, reference: Cycloid | Quintic, start: float) -> Motion:
    distance, duration, begin = reference.displacement, reference.duration, reference.start

    def motion(time: float) -> tuple[float, float, float]:
        s = (time - begin) / duration
        if s <= 0:
            return start, 0.0, 0.0
        if s >= 1:
            return start + distance, 0.0, 0.0
        value, slope, curve = profile(s)
        return start + distance * value, distance * slope / duration, distance * curve / duration**2

    return motion


def _multisine(reference: MultiSine, start: float) -> Motion:
    phases = reference.phases or (0.0,) * len(reference.amplitudes)
    waves = [(a, 2 * pi * f, p) for a, f, p in zip(reference.amplitudes, reference.frequencies, phases)]
    ramp = reference.ramp

    def motion(time: float) -> tuple[float, float, float]:
        x = v = a = 0.0
        for amplitude, w, phase in waves:
            s, c = amplitude * sin(w * time + phase), amplitude * cos(w * time + phase)
            x, v, a = x + s, v + w * c, a - w * w * s
        if time >= ramp:
            return start + x, v, a
        g, slope, curve = _quintic(max(time, 0.0) / ramp)
        gd, gdd = slope / ramp, curve / ramp**2
        return start + g * x, g * v + gd * x, g * a + 2 * gd * v + gdd * x

    return motion


def _table(reference: Table) -> Motion:
    """Not-a-knot spline inside, rest at the end positions outside."""
    times, positions = reference.times, reference.positions
    # One instant at a time: scipy's own call costs many times these few products.
    pieces = PPoly.from_spline(make_interp_spline(times, positions, k=reference.degree))
    proper = np.diff(pieces.x) > 0  # not those between the repeated knots at the ends
    starts, coefficients = pieces.x[:-1][proper].tolist(), pieces.c.T[proper].tolist()
    first, last = times[0], times[-1]

    def motion(time: float) -> tuple[float, float, float]:
        if time < first:
            return positions[0], 0.0, 0.0
        if time > last:
            return positions[-1], 0.0, 0.0
        k = bisect_right(starts, time) - 1
        s = float(time - starts[k])
        value = slope = curve = 0.0
        for coefficient in coefficients[k]:  # by Horner's rule; `curve` is half the second derivative
            curve = curve * s + slope
            slope = slope * s + value
            value = value * s + coefficient
        return value, slope, 2 * curve

    return motion
