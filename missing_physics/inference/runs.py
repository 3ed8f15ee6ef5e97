"""Recordings in the band of the motion, with everything that effects depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.standard import StandardModel
from missing_physics.standard.band import BandMotion, band_motion
from missing_physics.standard.prediction import ROOM_TEMPERATURE, Along, inertial_with_effects
from missing_physics.standard.rows import FRICTION, Rows, rows_of, without_friction
from reference_model.effects.base import JointSignals
from reference_model.model import RobotModel
from robot_model import Recording

__all__ = ["Run", "runs_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """One recording; N samples, K rows of the band, n joints.

    Attributes:
        model: of the robot without friction.
        along: its dynamics along the recorded motion.
        rows: what is compared.
        friction: of the standard model at each joint, as a force on it, shape (N, n) [N m or N].
        needed: torque by the standard model, shape (N, n).
        channels: recorded channels.
        temperature: of the joints [K], shape (N, n).
    """

    model: RobotModel
    along: Along
    rows: Rows
    friction: Array
    needed: Array
    channels: frozenset[str]
    temperature: Array

    @property
    def motion(self) -> BandMotion:
        """Of the joints, at full rate."""
        return self.along.motion

    def reduce(self, values: Array) -> Array:
        """Into the band."""
        return self.motion.reduce(values)

    @cached_property
    def loads(self) -> Array:
        """Bearing loads, shape (N, n, 4)."""
        return self.along.loads()

    def moved(self, k: int, series: Array) -> Array:
        """Torques more that it takes to move joint k by C small series more, (N, C); shape (N, n, C)."""
        spline = make_interp_spline(self.motion.time, series, k=5)
        bent = series, spline(self.motion.time, 1), spline(self.motion.time, 2)
        parts = (matrix[:, :, k, None] * one[:, None, :] for matrix, one in zip(self._jacobians, bent))
        return np.asarray(sum(parts))

    @cached_property
    def mass(self) -> Array:
        """Mass matrix of the joints, rotors included, as of a base that is held, shape (N, n, n)."""
        joints = len(self.model.joints)
        matrix = self.model.mass_matrix(
            self.motion.position, base=self.along.base, inner=self.along.inner, inertial=self.along.inertial
        )
        start = self.model.tree.offset
        return np.asarray(matrix[:, start : start + joints, start : start + joints])

    @property
    def is_rigid_and_fixed(self) -> bool:
        """Whether the joints are all that moves."""
        return self.along.base is None and self.along.inner is None

    @cached_property
    def _jacobians(self) -> tuple[Array, Array, Array]:
        """Derivatives of the torque by position, velocity, acceleration, shape (N, n, n) each."""
        motion = self.motion
        stiffness, damping, inertia = self.model.motion_jacobians(
            motion.position, motion.velocity, motion.acceleration, inertial=self.along.inertial
        )
        return stiffness, damping, inertia

    def signals(self, k: int) -> Array:
        """Of joint k in the order of `JointSignals.CHANNELS`, shape (N, 11)."""
        return self._signals[k]

    @cached_property
    def _signals(self) -> tuple[Array, ...]:
        return tuple(map(self._signals_of, range(len(self.model.joints))))

    def _signals_of(self, k: int) -> Array:
        motion = self.motion
        columns = [
            motion.time,
            motion.position[:, k],
            motion.velocity[:, k],
            motion.acceleration[:, k],
            self.needed[:, k],
            self.friction[:, k],
            *self.loads[:, k].T,
            self.temperature[:, k],
        ]
        assert len(columns) == len(JointSignals.CHANNELS)
        return np.column_stack(columns)


def runs_of(standard: StandardModel, recordings: Sequence[Recording]) -> tuple[Run, ...]:
    """The recordings in the band in which the standard model was fitted, about that model."""
    model = RobotModel(without_friction(standard.nominal))
    return tuple(_run(standard, model, recording) for recording in recordings)


def _run(standard: StandardModel, model: RobotModel, recording: Recording) -> Run:
    motion = band_motion(model.robot, recording, standard.cutoff)
    count = len(model.inertial_names)
    values = standard.estimate.values
    inertial = values[:count].copy()
    inertial[-3:] = inertial_with_effects(model)[-3:]
    along = Along.of(model, motion, inertial)
    joints = len(model.joints)
    own = values[count:].reshape(joints, len(FRICTION))
    friction = own[:, 0] * motion.velocity + own[:, 1] * motion.direction
    temperature = [_series(recording, f"{joint}.temperature", motion.time) for joint in model.joints]
    return Run(
        model=model,
        along=along,
        rows=rows_of(model, recording, standard.cutoff),
        friction=-friction,
        needed=along.needed + friction + own[:, 2],
        channels=frozenset(recording.channels),
        temperature=np.column_stack(temperature),
    )


def _series(recording: Recording, channel: str, time: Array) -> Array:
    if channel not in recording:
        return np.full(time.size, ROOM_TEMPERATURE)
    values = recording[channel]
    good = np.isfinite(values)
    inside = np.clip(time, recording.time[good][0], recording.time[good][-1])
    return np.asarray(make_interp_spline(recording.time[good], values[good], k=1)(inside))
