"""Consistency of a base's attitude and gyro: order of the quaternion, frames, signs and units.

Between two instants the attitude changes by a rotation vector, expressed in base axes or in inertial axes;
the integral of a gyro in base axes is the former. Every common convention is tried. One is reported only if
the conventions of the native channels (w, x, y, z; base to inertial axes; rates in base axes, rad/s) fail for
any gain and bias of the gyro, and if it fits to a few percent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.inspection.findings import Finding
from missing_physics.recordings.inspection.shares import percent
from missing_physics.recordings.maps.corrections import Correction
from robot_model import Recording

__all__ = ["attitude_findings", "turned"]

Array = NDArray[np.float64]

ATTITUDE = tuple(f"base.attitude.{axis}" for axis in "wxyz")
GYRO = tuple(f"base.angular_velocity.{axis}" for axis in "xyz")
#: Windows over which turns are compared.
WINDOWS = 200
#: Plausible gains of a gyro, and those that count as one for a reported convention.
BELIEVED, ONE = (0.1, 3.0), (0.8, 1.25)
#: Largest unexplained fraction of the rotation for a convention, and the factor by which that of the native
#: one must exceed it.
HOLDS, DECISIVE = 0.05, 20.0
#: Among conventions with less than this multiple of the smallest residual, the simplest is reported.
ALIKE = 3.0
#: Tolerance of a quaternion's length.
LENGTH = 0.05

_UNITS = ((1.0, ""), (math.pi / 180.0, "in degrees per second"), (math.pi / 30.0, "in turns per minute"))


@dataclass(frozen=True)
class _Convention:
    last: bool  # the real part is the last of the four
    inertial: bool  # turns in inertial axes
    sign: float
    unit: float
    unit_words: str

    @property
    def changes(self) -> int:
        return self.last + (self.inertial or self.sign < 0) + (self.unit != 1.0)

    def words(self) -> str:
        parts = []
        if self.last:
            parts.append("base.attitude is in the order x, y, z, w")
        if self.inertial and self.sign < 0:
            parts.append("base.attitude is the rotation from inertial to base axes")
        elif self.inertial:
            parts.append("base.angular_velocity is given in inertial axes and not in those of the base")
        elif self.sign < 0:
            parts.append("base.angular_velocity runs against the turning of base.attitude")
        if self.unit_words:
            parts.append(f"base.angular_velocity is {self.unit_words}")
        return " and ".join(parts)

    def corrections(self) -> tuple[Correction, ...]:
        """Corrections that a map can express; it cannot rotate rates in other axes."""
        found = {}
        if self.last:
            for channel, source in zip(ATTITUDE, (ATTITUDE[3], *ATTITUDE[:3])):
                found[channel] = Correction(channel, source=source)
        if self.inertial and self.sign < 0:
            for channel in ATTITUDE[1:]:
                source = found[channel].source if channel in found else ""
                found[channel] = Correction(channel, source=source, scale=-1.0)
        factor = self.unit * (self.sign if not self.inertial else 1.0)
        if factor != 1.0 and not (self.inertial and self.sign > 0):
            found |= {channel: Correction(channel, scale=factor) for channel in GYRO}
        return tuple(found.values())


def attitude_findings(recording: Recording) -> Iterator[Finding]:
    """Findings of quaternions with wrong length, and of conventions other than the native one."""
    if any(channel not in recording for channel in ATTITUDE):
        return
    attitude = np.column_stack([recording[channel] for channel in ATTITUDE])
    length = float(np.nanmedian(np.linalg.norm(attitude, axis=1)))
    if abs(length - 1.0) > LENGTH:
        yield Finding(
            "error",
            "quaternion",
            ATTITUDE[0],
            f"the length of base.attitude is {length:.4g} and that of a rotation's quaternion is 1; give its "
            "parts w, x, y, z and no angles.",
            {"length": length},
        )
    elif all(channel in recording for channel in GYRO):
        rate = np.column_stack([recording[channel] for channel in GYRO])
        yield from _against_gyro(recording.time, attitude, rate)


def _against_gyro(time: Array, attitude: Array, rate: Array) -> Iterator[Finding]:
    good = np.isfinite(attitude).all(axis=1) & np.isfinite(rate).all(axis=1)
    if good.sum() < WINDOWS:
        return
    time, attitude, rate = time[good], attitude[good], rate[good]
    edges = np.unique(np.linspace(0, time.size - 1, WINDOWS + 1).astype(int))
    steps = np.diff(time)[:, None]
    whole = np.vstack([np.zeros(3), np.cumsum(0.5 * (rate[1:] + rate[:-1]) * steps, axis=0)])
    read, spans = np.diff(whole[edges], axis=0), np.diff(time[edges])
    turns = {
        (last, inertial): turned(np.roll(attitude, 1, axis=1) if last else attitude, edges, inertial=inertial)
        for last in (False, True)
        for inertial in (False, True)
    }
    native = _left(turns[False, False], read, spans, BELIEVED)
    trials = []
    for (last, inertial), turn in turns.items():
        for sign in (1.0, -1.0):
            for unit, words in _UNITS:
                convention = _Convention(last, inertial, sign, unit, words)
                trials.append((_left(turn, sign * unit * read, spans, ONE), convention))
    least = min(left for left, _ in trials)
    left, best = min(
        (trial for trial in trials if trial[0] <= ALIKE * least),
        key=lambda trial: (trial[1].changes, trial[0]),
    )
    if best.changes and left < HOLDS and left * DECISIVE < native:
        yield Finding(
            "error",
            "convention",
            GYRO[0] if best.unit != 1.0 or not best.last else ATTITUDE[0],
            f"base.attitude and base.angular_velocity contradict each other: {best.words()} (as named, "
            f"{percent(min(native, 1.0))} of the turning disagrees, corrected {percent(left)})"
            + ("." if best.corrections() else "; turn it into the axes of the base before it is read."),
            {"left": left, "native": native},
            best.corrections(),
        )


def turned(attitude: Array, edges: NDArray[np.int_], *, inertial: bool = False) -> Array:
    """Rotation vectors [rad] between the instants `edges`, shape (M, 3), in base or in inertial axes.

    Args:
        attitude: quaternion w, x, y, z, base to inertial axes, shape (N, 4).
        edges: increasing indices into it, shape (M + 1,).
        inertial: axes of the vectors; those of the base at the first of both instants otherwise.
    """
    unit = attitude / np.linalg.norm(attitude, axis=1, keepdims=True)
    first, second = unit[edges[:-1]], unit[edges[1:]]
    back = first * np.array([1.0, -1.0, -1.0, -1.0])
    change = _product(second, back) if inertial else _product(back, second)
    change *= np.where(change[:, :1] < 0, -1.0, 1.0)  # both signs are the same rotation
    sine = np.linalg.norm(change[:, 1:], axis=1)
    angle = 2.0 * np.arctan2(sine, change[:, 0])
    return np.asarray(change[:, 1:] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)[:, None])


def _product(a: Array, b: Array) -> Array:
    w = a[:, :1] * b[:, :1] - np.sum(a[:, 1:] * b[:, 1:], axis=1, keepdims=True)
    v = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])
    return np.hstack([w, v])


def _left(turn: Array, read: Array, spans: Array, gains: tuple[float, float]) -> float:
    """Fraction of the gyro's readings that gain times rotation plus bias does not explain."""
    along = spans / np.linalg.norm(spans)
    x, y = (part - np.outer(along, along @ part) for part in (turn, read))
    power = float((y * y).sum())
    if power <= 0.0 or not (x * x).any():
        return 1.0
    gain = float(np.clip((x * y).sum() / (x * x).sum(), *gains))
    return float(((y - gain * x) ** 2).sum()) / power
