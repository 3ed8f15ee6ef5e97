"""Columns of the standard model at the rate of the recording, without the filter of the band."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque
from missing_physics.checks.clocks import Clock
from missing_physics.evaluation.band import SPOILED_PERIODS, low_passed
from missing_physics.standard.band import band_motion, position_channel
from missing_physics.standard.prediction import Along, inertial_with_effects, torque_of_effects
from missing_physics.standard.rows import FRICTION
from reference_model.evaluation.model import RobotModel
from robot_model import InputError, Recording

__all__ = ["Columns", "columns_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Columns:
    """One recording: N samples, n joints, X parameters.

    Attributes:
        step: time between samples [s].
        torque: recorded torque minus that of the robot's other effects, shape (N, n).
        design: derivatives of the torques by inertial parameters, friction, and the common delay, (N, n, X).
        position: recorded minus smoothed position, shape (N, n).
        counted: mask of the samples in which a joint slides, away from the ends, shape (N, n).
        inertia: mean inertia at each joint, shape (n,).
        encoder, torque_noise: stated or estimated noise per sample, shape (n,) each.
    """

    step: float
    torque: Array
    design: Array
    position: Array
    counted: NDArray[np.bool_]
    inertia: Array
    encoder: Array
    torque_noise: Array


def columns_of(model: RobotModel, recording: Recording, cutoff: float, settled: float) -> Columns:
    """The columns of one recording.

    Args:
        model: of the robot without friction, rigid and on a fixed base.
        recording: with the position of every joint and its torque or current.
        cutoff: end of the band [Hz]; positions are smoothed at the same multiple of it as by the rows.
        settled: time after which the filter's start has no influence [s].

    Raises:
        InputError: a torque is not recorded.
    """
    robot = model.robot
    channels = [position_channel(robot, recording, joint) for joint in model.joints]
    sources = [actuator_torque(robot, recording, joint) for joint in model.joints]
    if any(channel is None or channel.endswith(".voltage") for channel, _ in sources):
        raise InputError("torque or current is not recorded at every joint.")
    torques = [(str(channel), factor) for channel, factor in sources]
    thin = band_motion(robot, recording, cutoff)
    clock = Clock.of(recording, [*channels, *(channel for channel, _ in torques)])
    raw = np.column_stack([clock.values(channel) for channel in channels])
    smooth = low_passed(raw, rate=clock.rate, cutoff=thin.smoothing)
    spline = make_interp_spline(clock.time, smooth, k=5)
    motion = replace(
        thin,
        time=clock.time,
        position=smooth,
        velocity=np.asarray(spline(clock.time, 1)),
        acceleration=np.asarray(spline(clock.time, 2)),
        torque=np.column_stack([factor * clock.values(channel) for channel, factor in torques]),
    )
    along = Along.of(model, motion, inertial_with_effects(model))
    inertial, joints = along.regressor, len(model.joints)
    design = np.zeros((clock.time.size, joints, inertial.shape[2] + joints * len(FRICTION) + 1))
    design[:, :, : inertial.shape[2] - 3] = inertial[:, :, :-3]  # gravity is known
    friction = motion.velocity, motion.direction, np.ones_like(motion.velocity)
    for k in range(joints):
        first = inertial.shape[2] + k * len(FRICTION)
        for own, values in enumerate(friction):
            design[:, k, first + own] = values[:, k]
    design[:, :, -1] = -np.gradient(motion.smooth_torque, clock.time, axis=0)
    away = max(settled, SPOILED_PERIODS / cutoff)
    inside = (clock.time >= clock.time[0] + away) & (clock.time <= clock.time[-1] - away)
    return Columns(
        step=1.0 / clock.rate,
        torque=motion.torque - torque_of_effects(along) - along.constant(inertial),
        design=design,
        position=raw - smooth,
        counted=motion.slides & inside[:, None],
        inertia=np.sqrt(np.mean(np.einsum("kii->ki", along.mass) ** 2, axis=0)),
        encoder=thin.velocity_noise / (2.0 * np.pi * np.sqrt(2.0 * thin.smoothing**3 / (3.0 * clock.rate))),
        torque_noise=np.asarray(thin.torque_noise),
    )
