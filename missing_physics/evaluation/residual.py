"""Residual of a robot file: recorded minus predicted torques, and angular rates of a free base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from missing_physics.evaluation.band import Band, low_passed
from missing_physics.evaluation.joint_motion import JointMotion
from missing_physics.evaluation.prediction import predicted
from missing_physics.evaluation.vibration.whitening import Vibration
from robot_model import Recording, Robot, unit_of

__all__ = ["Evaluation", "evaluate"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Evaluation:
    """Recorded and predicted channels in one frequency band, without the ends spoiled by the filter.

    Attributes:
        channels: `DRIVE.torque` of the drives, then `base.angular_velocity.AXIS` for each axis of a free base
            with a gyro; m in all.
        units: of the channels.
        time: [s], shape (N,).
        measured: torques of the actuators at the joints, and rates minus their means, shape (N, m); NaN where
            a torque is not known.
        predicted: the same quantities by the robot file, shape (N, m); equal to the measured ones where a
            joint with dry friction is near rest, see `sliding`.
        band: the frequencies in which they are compared.
    """

    channels: tuple[str, ...]
    units: tuple[str, ...]
    time: Array
    measured: Array
    predicted: Array
    band: Band

    @property
    def residual(self) -> Array:
        """Measured minus predicted, shape (N, m)."""
        return np.asarray(self.measured - self.predicted)

    def rms(self) -> dict[str, float]:
        """rms of the residual by channel, in its unit, of those whose torque is known."""
        found = np.sqrt(np.mean(self.residual**2, axis=0))
        return {channel: float(v) for channel, v in zip(self.channels, found) if np.isfinite(v)}

    def at(self, instants: ArrayLike, channel: str) -> Array:
        """Residual of one channel at `instants` [s] between the first and the last one, shape (K,)."""
        column = self.residual[:, self.channels.index(channel)]
        return np.interp(np.asarray(instants, dtype=float), self.time, column)


def evaluate(robot: Robot, recording: Recording, band: Band) -> Evaluation:
    """Compare the torques that `robot` needs along the recorded motion with the recorded ones.

    The initial vibration of links is not recorded: the best-fitting free vibration of the links is removed
    from the residual. The derivatives of a recorded motion are noisy, and the noise excites flexible links:
    for robots with lightly damped modes the residual contains this response as well.

    Args:
        robot: any description, with its effects.
        recording: with `DRIVE.position` or `DRIVE.motor_position` of every drive, and torque, current
            or voltage of those that are compared.
        band: the frequencies.

    Raises:
        InputError: a position is not recorded, too few samples are, or the robot cannot have one of its
            effects.
    """
    motion = JointMotion.of(robot, recording, band)
    prediction = predicted(robot, motion)
    channels = [f"{drive.name}.torque" for drive in robot.drives]
    smooth = low_passed(np.nan_to_num(motion.torque), rate=motion.rate, cutoff=band.motion)
    residual = np.where(np.isfinite(motion.torque), (smooth - prediction.torque) * motion.shares, np.nan)
    pairs = list(zip(motion.torque.T, residual.T))
    if prediction.base_rates is not None:
        axes = [k for k in range(3) if np.isfinite(motion.base_rates[:, k]).all()]
        channels += [f"base.angular_velocity.{'xyz'[k]}" for k in axes]
        rates = motion.base_rates[:, axes]
        pairs += list(zip(rates.T, (rates - prediction.base_rates[:, axes]).T))
    spoiled = band.spoiled(motion.rate)
    kept = slice(spoiled, motion.time.size - spoiled)
    both = low_passed(np.array(pairs).transpose(2, 0, 1), rate=motion.rate, cutoff=band.torque)[kept]
    count = len(robot.drives)
    both[:, count:] -= both[:, count:].mean(axis=0)  # a gyro's bias is not a property of the robot
    prismatic = {drive.name for drive in robot.drives if drive.kind == "prismatic"}
    units = tuple(unit_of(c, prismatic=c.split(".")[0] in prismatic) for c in channels)
    measured, residual = both[:, :, 0], both[:, :, 1]
    columns = prediction.vibration * motion.shares[:, :, None]
    residual[:, :count] = _without_vibration(
        residual[:, :count], low_passed(columns, rate=motion.rate, cutoff=band.torque)[kept]
    )
    return Evaluation(tuple(channels), units, motion.time[kept], measured, measured - residual, band)


def _without_vibration(residual: Array, columns: Array) -> Array:
    """Residual of the torques, (N, n), minus the best-fitting free vibration; columns (N, n, V)."""
    known = np.isfinite(residual)
    if not columns.shape[2] or not known.any():
        return residual
    found = np.where(known, residual, 0.0)
    spread = np.sum(found**2, axis=0) / np.maximum(known.sum(axis=0), 1)
    weight = known / np.maximum(spread, 1e-12 * max(float(spread.max()), 1e-300))
    return np.where(known, Vibration.of(columns, weight).removed(found), np.nan)
