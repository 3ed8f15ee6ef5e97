"""The angular rates of a free base in one recording, and their prediction by the nominal robot."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.checks.gyros import covered, gyro_noise
from missing_physics.motion.base.response import Floating
from missing_physics.motion.inverse import MotionDynamics
from missing_physics.motion.low_pass import LowPass
from reference_model.effects.pushing import BodySeries
from reference_model.kinematics.spatial import rotation_from_rpy
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion
from robot_model import Recording

__all__ = ["Rates"]

Array = NDArray[np.float64]

#: Instants per period of the cut-off at which the response of the base is computed. The trapezoidal rule then
#: errs by 0.5 % of the frequency of vibrations at a fifth of the cut-off, where the motion lies.
DENSE = 5


@dataclass(frozen=True)
class Rates:
    """Gyros of one recording, m channels, N samples.

    Attributes:
        dynamics: of the nominal robot along the recording.
        recording: the recording.
        channels: of the gyros, `base.angular_velocity.AXIS`.
    """

    dynamics: MotionDynamics
    recording: Recording
    channels: tuple[str, ...]

    @property
    def axes(self) -> list[int]:
        """Axis of each channel."""
        return ["xyz".index(channel[-1]) for channel in self.channels]

    @property
    def low_pass(self) -> LowPass:
        """The filter through which rates are compared."""
        return self.dynamics.motion.low_pass

    @property
    def time(self) -> Array:
        """Times of the rows [s], shape (K,)."""
        return self.dynamics.motion.reduced_time

    @cached_property
    def measured(self) -> Array:
        """Recorded rates [rad/s], shape (N, m)."""
        return np.column_stack([self.dynamics.motion.others[channel] for channel in self.channels])

    @property
    def base(self) -> BaseMotion:
        """Motion of the base predicted by the robot file."""
        found = self.dynamics.base
        assert found is not None
        return found

    @cached_property
    def predicted(self) -> Array:
        """Rates predicted by the robot file, starting from rest [rad/s], shape (N, m)."""
        return np.asarray(self.base.angular_velocity[:, self.axes])

    @cached_property
    def turning(self) -> Array:
        """Angular velocity of the base, (N, 3): smoothed gyro rates, and predicted ones about other axes."""
        found = self.base.angular_velocity.copy()
        motion = self.dynamics.motion
        found[:, self.axes] = LowPass(motion.low_pass.rate, motion.motion_cutoff).smooth(self.measured)
        return found

    def reduce(self, values: Array) -> Array:
        """Filter and decimate series at the full rate along the first axis."""
        return self.low_pass.reduce(values)

    def rows(self, rates: Array) -> Array:
        """Convert rates of the base at the instants of `floating` to rows, shape (G, 3, C) to (K, m, C)."""
        full, own = self.dynamics.motion.time, rates[:, self.axes]
        known = np.isfinite(own).all(axis=(0, 1))
        inside = make_interp_spline(self.floating.time, np.where(known, own, 0.0), k=3)(full)
        return np.where(known, self.reduce(np.asarray(inside)), np.nan)

    @property
    def instants(self) -> slice:
        """Samples at which the response is computed."""
        return slice(None, None, max(1, int(self.low_pass.rate / (DENSE * self.low_pass.cutoff))))

    @cached_property
    def rotation(self) -> Array:
        """Rotation from base to inertial axes by integrating the rates, shape (N, 3, 3)."""
        motion = self.dynamics.motion
        steps = _rotations(0.5 * (self.turning[1:] + self.turning[:-1]) * np.diff(motion.time)[:, None])
        found = np.empty((motion.time.size, 3, 3))
        found[0] = rotation_from_rpy(self.dynamics.model.robot.base.rpy)
        for k, step in enumerate(steps):
            found[k + 1] = found[k] @ step
        return found

    def along(self, some: slice) -> tuple[tuple[Array, Array, Array], InnerMotion | None]:
        """Position, velocity and acceleration of the joints, shape (G, n) each, and the links' vibration."""
        motion, inner = self.dynamics.motion, self.dynamics.inner
        joints = motion.position[some], motion.velocity[some], motion.acceleration[some]
        if inner is not None:
            inner = InnerMotion(*(getattr(inner, name)[some] for name in inner.__dataclass_fields__))
        return joints, inner

    @cached_property
    def floating(self) -> Floating:
        """The nominal robot's response."""
        return self.response(self.instants)

    def response(self, some: slice) -> Floating:
        """The nominal robot's response at some of the samples."""
        model, (joints, _) = self.dynamics.model, self.along(some)
        still = BaseMotion.at_rest(np.array([1.0, 0.0, 0.0, 0.0]), len(joints[0]))
        mass = model.mass_matrix(joints[0], base=still)
        return Floating(self.dynamics.motion.time[some], self.rotation[some], mass, *model.elasticity())

    @cached_property
    def signals(self) -> BodySeries:
        """Motion of the base, for forces on it; positions are as accurate as the robot file."""
        some = self.instants
        floating, ((_, velocity, _), inner) = self.floating, self.along(some)
        mass, turning = floating.mass, self.turning[some]
        moving = velocity if inner is None else np.hstack([velocity, inner.modal_rates])
        carried = mass[:, :3, 3:6] @ turning[:, :, None] + mass[:, :3, 6:] @ moving[:, :, None]
        linear = -carried[:, :, 0] / mass[:, 0, 0, None]  # no momentum
        speed = (floating.rotation @ linear[:, :, None])[:, :, 0]
        place = np.asarray(self.dynamics.model.robot.base.position, dtype=float)
        moved = np.zeros_like(speed)
        np.cumsum(floating.step / 2 * (speed[1:] + speed[:-1]), axis=0, out=moved[1:])
        return BodySeries(floating.time, place + moved, floating.rotation, np.column_stack([linear, turning]))

    @cached_property
    def vibration(self) -> Array:
        """Rows of all free vibrations of the links from the start, shape (K, m, V)."""
        if not self.dynamics.model.tree.modal:
            return np.zeros((self.time.size, len(self.axes), 0))
        vibration = self.response(slice(None)).free_vibration()
        return self.reduce(vibration[:, self.axes])

    @cached_property
    def covered(self) -> NDArray[np.bool_]:
        """Mask of the rows without a gap of the gyro within the filter's memory, shape (K, m)."""
        memory = 0.5 / self.low_pass.cutoff
        found = []
        for channel in self.channels:
            gone = self.recording.time[~covered(self.recording, channel)]
            near = np.searchsorted(gone, self.time + memory) > np.searchsorted(gone, self.time - memory)
            found.append(~near)
        return np.column_stack(found)

    @cached_property
    def noise(self) -> Array:
        """rms in the rows due to white noise of gyros and encoders [rad/s], shape (m,)."""
        motion, robot = self.dynamics.motion, self.dynamics.model.robot
        cutoff = motion.low_pass.cutoff
        own = [gyro_noise(robot, self.recording, channel, cutoff) for channel in self.channels]
        count = motion.position.shape[1]
        lever = self.floating.turned(self.floating.mass[:, :6, 6 : 6 + count])[:, self.axes]
        speed = motion.velocity_noise * (cutoff / motion.motion_cutoff) ** 1.5
        return np.hypot(own, np.sqrt(np.mean(np.sum((lever * speed) ** 2, axis=2), axis=0)))


def _rotations(turns: Array) -> Array:
    """Rotation matrices of rotation vectors [rad], shape (N, 3) to (N, 3, 3), by Rodrigues' formula."""
    angle = np.linalg.norm(turns, axis=1)[:, None, None]
    cross = np.zeros((len(turns), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[:, j, i], cross[:, i, j] = turns[:, k], -turns[:, k]
    half = 0.5 * angle
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(half / np.pi) ** 2 * cross @ cross
