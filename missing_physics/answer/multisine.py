"""Reference motions that a robot can run: sums of sines that begin and end at rest, inside its limits."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_model import Joint

__all__ = ["Limits", "MultiSines", "as_csv"]

Array = NDArray[np.float64]

#: Sines of each joint, and their frequencies [Hz].
SINES = 4
FREQUENCIES = (0.05, 2.0)
#: Speed of the slowest motion drawn, as a part of the allowed speed.
SLOWEST = 0.05
#: Part of the allowed range and speed that a motion uses.
MARGIN = 0.9
#: The motion rises from rest and falls back to it in this part of its length each.
RAMP = 0.15


@dataclass(frozen=True)
class Limits:
    """Limits of the joints: start, range [rad or m] and speed [per s], shape (n,) each."""

    start: Array
    lower: Array
    upper: Array
    speed: Array

    @classmethod
    def of(cls, joints: Sequence[Joint], position: Array, velocity: Array) -> Limits:
        """Limits of the description, else what was recorded: positions and velocities, shape (N, n)."""
        ranges = [
            joint.position_limits or (float(position[:, k].min()), float(position[:, k].max()))
            for k, joint in enumerate(joints)
        ]
        speed = [
            joint.velocity_limit or float(np.abs(velocity[:, k]).max()) for k, joint in enumerate(joints)
        ]
        lower, upper = np.array(ranges).T
        start = np.array([joint.initial_position for joint in joints])
        return cls(np.clip(start, lower, upper), lower, upper, np.array(speed))


@dataclass(frozen=True)
class MultiSines:
    """Parameters of a motion of n joints; any values give a motion inside the limits.

    Attributes:
        slowness: logarithm of the part of the allowed speed that is used.
        frequencies: their logarithms, shape (n, SINES).
        weights: logarithms of the sines' relative amplitudes, shape (n, SINES).
        phases: [rad], shape (n, SINES).
    """

    slowness: float
    frequencies: Array
    weights: Array
    phases: Array

    @classmethod
    def drawn(cls, joints: int, chance: np.random.Generator) -> MultiSines:
        """A random motion of `joints` joints."""
        shape = (joints, SINES)
        low, high = np.log(FREQUENCIES)
        return cls(
            float(chance.uniform(np.log(SLOWEST), 0.0)),
            chance.uniform(low, high, shape),
            np.log(chance.dirichlet(np.ones(SINES), joints) + 1e-6),
            chance.uniform(0.0, 2 * np.pi, shape),
        )

    def near(self, spread: float, chance: np.random.Generator) -> MultiSines:
        """A motion whose parameters differ by about `spread`, in units of their scales."""
        shape = self.phases.shape
        low, high = np.log(FREQUENCIES)
        frequencies = self.frequencies + spread * chance.standard_normal(shape)
        return replace(
            self,
            slowness=float(np.clip(self.slowness + spread * chance.normal(), np.log(SLOWEST), 0.0)),
            frequencies=np.clip(frequencies, low, high),
            weights=self.weights + 2 * spread * chance.standard_normal(shape),
            phases=self.phases + np.pi * spread * chance.standard_normal(shape),
        )

    def positions(self, time: Array, limits: Limits) -> Array:
        """Joint positions, shape (N, n); `time` [s] rises from zero.

        Each joint leaves its start at rest, moves about the middle of its range and comes back.
        """
        whole = float(time[-1])
        ramp = _smooth(np.minimum(time, whole - time) / (RAMP * whole))
        columns = []
        for joint, start in enumerate(limits.start):
            angle = 2 * np.pi * np.outer(time, np.exp(self.frequencies[joint])) + self.phases[joint]
            weight = np.exp(self.weights[joint] - self.weights[joint].max())
            shape = np.sin(angle) @ (weight / weight.sum())
            shape -= 0.5 * (shape.max() + shape.min())
            lower, upper = limits.lower[joint], limits.upper[joint]
            shape *= 0.5 * MARGIN * (upper - lower) / max(float(np.abs(shape).max()), 1e-12)
            away = ramp * (0.5 * (lower + upper) - start + shape)
            fastest = float(np.abs(np.gradient(away, time)).max())
            allowed = MARGIN * np.exp(self.slowness) * limits.speed[joint]
            columns.append(start + away * min(1.0, allowed / max(fastest, 1e-12)))
        return np.column_stack(columns)


def _smooth(part: Array) -> Array:
    """From 0 to 1 with first and second derivatives zero at both ends."""
    s = np.clip(part, 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def as_csv(joints: Sequence[str], time: Array, position: Array) -> str:
    """A motion as a file of references: `time` [s] and positions of these joints, shape (N, n)."""
    text = io.StringIO()
    header = ",".join(["time", *(f"{joint}.reference_position" for joint in joints)])
    columns = np.column_stack([time, position])
    np.savetxt(text, columns, fmt="%.9g", delimiter=",", header=header, comments="")
    return text.getvalue()
