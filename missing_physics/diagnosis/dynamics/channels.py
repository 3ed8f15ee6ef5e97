"""Channels that respond to corrections of a robot's motion, and how they are derived from it.

Strain and deflection of a link are what its modes make of them. Gyro, attitude and accelerometer of a free
base see how joints and links move by momentum, and a tip's accelerometer both. A second encoder of a joint
sees the same joint. Everything is linear in the small correction about the reconstructed motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import make_interp_spline

from missing_physics.diagnosis.dynamics.accelerations import AccelerationRows
from missing_physics.diagnosis.dynamics.base_rates import GYRO, rotation_matrices
from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.dynamics.joints_from_base import ATTITUDE
from reference_model.passive.base_motion import BaseMotion

__all__ = ["Seen", "seen"]

Array = NDArray[np.float64]

#: What an accelerometer at the origin of a free base measures.
ACCELEROMETER = tuple(f"base.linear_acceleration.{axis}" for axis in "xyz")


@dataclass(frozen=True)
class Seen:
    """One channel.

    Attributes:
        channel: its name; of an attitude the angle about an inertial axis is one.
        kind: what measures it.
        recorded: as it was, shape (N,); NaN where it was not.
        foretold: without the correction, shape (N,).
        noise: standard deviation per sample; not a number or zero where unknown.
        guessed: whether that was only estimated.
        rows, pull: as in `Sight`, shape (N, 2 g) and (N, g); None where nothing.
        turn: as in `Sight`, of channels that tell the base's angle, shape (P, 3, 2 g); None of others.
        axis: about which they tell it.
    """

    channel: str
    kind: str
    recorded: Array
    foretold: Array
    noise: float
    guessed: bool
    rows: Array | None = None
    pull: Array | None = None
    turn: Array | None = None
    axis: int = -1


def seen(dynamics: MotionDynamics) -> Iterator[Seen]:
    """Every channel of `dynamics.motion` that sees something beside the encoders of its positions."""
    looking = _Looking(dynamics)
    yield from looking.encoders()
    yield from looking.links()
    if dynamics.base is not None:
        yield from looking.gyro(dynamics.base)
        yield from looking.attitude(dynamics.base)
        yield from looking.accelerometer(dynamics.base)


class _Looking:
    def __init__(self, dynamics: MotionDynamics) -> None:
        self._dynamics, self._motion = dynamics, dynamics.motion
        self._count, self._size = len(dynamics.motion.time), dynamics.motion_response.inertia.shape[1]
        poses = np.linspace(0, self._count - 1, len(dynamics.motion_response.inertia))
        self._at = np.unique(poses.astype(int))

    def _of(self, channel: str, kind: str, foretold: Array, rows: Array | None = None) -> Seen:
        motion = self._motion
        return Seen(
            channel,
            kind,
            np.where(motion.there(channel), motion.others[channel], np.nan),
            foretold,
            motion.noise.get(channel, 0.0),
            channel in motion.guessed,
            rows,
        )

    def _everywhere(self, values: Array) -> Array:
        """At every sample what is known at `_at`."""
        return np.asarray(make_interp_spline(self._at, values, k=3)(np.arange(self._count)))

    @cached_property
    def _turning(self) -> Array:
        """Angular velocity of the base, in its axes, by the correction at `_at`, shape (P, 3, 2 g)."""
        return self._dynamics.base_rows(self._at)

    @cached_property
    def _accelerating(self) -> AccelerationRows:
        return AccelerationRows(self._dynamics, self._at)

    def encoders(self) -> Iterator[Seen]:
        """Of joints with one at the motor, which tells the position, the one at the link."""
        for k, channel in enumerate(self._motion.position_channels):
            own = f"{channel.split('.')[0]}.position"
            if own != channel and own in self._motion.others:
                rows = np.zeros((self._count, 2 * self._size))
                rows[:, k] = 1.0
                yield self._of(own, own, self._motion.position[:, k], rows)

    def links(self) -> Iterator[Seen]:
        """Gauges, deflection and acceleration of the tip of each link that bends."""
        dynamics, inner, n = self._dynamics, self._dynamics.inner, len(self._dynamics.model.joints)
        if inner is None:
            return
        for body in dynamics.model.tree.bodies:
            if body.flexible is None:
                continue
            columns = n + body.modal + np.arange(body.modes)
            x = inner.modal[:, body.modal : body.modal + body.modes]
            for k, shape in enumerate(body.flexible.strain):
                channel = f"{body.name}.strain.{k + 1}"
                if channel in self._motion.others:
                    rows = np.zeros((self._count, 2 * self._size))
                    rows[:, columns] = shape
                    yield self._of(channel, f"{body.name}.strain", x @ shape, rows)
            tip = body.flexible.translations[body.flexible.tip]
            short, axis = np.zeros((body.modes, body.modes)), np.zeros(3)
            if body.flexible.foreshortening is not None and body.flexible.axis is not None:
                short, axis = body.flexible.foreshortening[body.flexible.tip], body.flexible.axis
            for k, letter in enumerate("xyz"):
                channel = f"{body.name}.tip_deflection.{letter}"
                if channel in self._motion.others:
                    rows = np.zeros((self._count, 2 * self._size))
                    rows[:, columns] = tip[k] - axis[k] * (x @ short)
                    shortened = 0.5 * np.einsum("ti,ij,tj->t", x, short, x)
                    kind = f"{body.name}.tip_deflection"
                    yield self._of(channel, kind, x @ tip[k] - axis[k] * shortened, rows)
            felt = tuple(f"{body.name}.tip_acceleration.{axis}" for axis in "xyz")
            if any(channel in self._motion.others for channel in felt):
                foretold = dynamics.tip_acceleration(body.name)
                yield from self._accelerations(felt, foretold, self._accelerating.tip(body.name))

    def _accelerations(self, channels: tuple[str, ...], foretold: Array, by: Array) -> Iterator[Seen]:
        """Accelerometers, from their derivatives by [velocities; accelerations] at `_at`."""
        both = self._everywhere(by)
        for k, channel in enumerate(channels):
            if channel in self._motion.others:
                rows = np.zeros((self._count, 2 * self._size))
                rows[:, self._size :] = both[:, k, : self._size]
                one = self._of(channel, channel[:-2], foretold[:, k], rows)
                yield replace(one, pull=both[:, k, self._size :])

    def gyro(self, base: BaseMotion) -> Iterator[Seen]:
        """About the base's axes."""
        for axis, channel in enumerate(GYRO):
            if channel in self._motion.others:
                rows = self._everywhere(self._turning[:, axis])
                yield self._of(channel, channel[:-2], base.angular_velocity[:, axis], rows)

    def attitude(self, base: BaseMotion) -> Iterator[Seen]:
        """The angle about inertial axes by which the base is turned otherwise."""
        motion = self._motion
        if any(channel not in motion.others for channel in ATTITUDE):
            return
        there = np.all([motion.there(channel) for channel in ATTITUDE], axis=0)
        apart = _angle(np.column_stack([motion.others[channel] for channel in ATTITUDE]), base.attitude)
        turned = rotation_matrices(base.attitude)
        travelled = np.einsum("nij,nj->ni", turned, base.angular_velocity)
        angle = cumulative_trapezoid(travelled, motion.time, axis=0, initial=0.0)
        noise = 2.0 * np.sqrt(np.mean([motion.noise.get(channel, 0.0) ** 2 for channel in ATTITUDE]))
        turn = turned[self._at] @ self._turning
        for axis in range(3):
            yield Seen(
                f"base.attitude.{'xyz'[axis]}",
                "base.attitude",
                np.where(there, angle[:, axis] + apart[:, axis], np.nan),
                angle[:, axis],
                float(noise),
                any(channel in motion.guessed for channel in ATTITUDE),
                turn=turn,
                axis=axis,
            )

    def accelerometer(self, base: BaseMotion) -> Iterator[Seen]:
        """Of the base's origin."""
        if any(channel in self._motion.others for channel in ACCELEROMETER):
            foretold = base.linear_acceleration
            yield from self._accelerations(ACCELEROMETER, foretold, self._accelerating.base())


def _angle(recorded: Array, foretold: Array) -> Array:
    """Small rotation from one attitude w, x, y, z to another, inertial axes [rad], shape (N, 3)."""
    a, b = (part / np.linalg.norm(part, axis=1, keepdims=True) for part in (recorded, foretold))
    w = np.sum(a * b, axis=1, keepdims=True)  # of a times the inverse of b
    vector = a[:, 1:] * b[:, :1] - a[:, :1] * b[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    vector *= np.where(w < 0.0, -1.0, 1.0)  # both signs are the same attitude
    sine = np.linalg.norm(vector, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, np.abs(w))
    return np.asarray(vector * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0))
