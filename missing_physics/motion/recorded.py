"""The nominal robot's dynamics along recordings, all in one band."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from missing_physics.checks.gyros import gyro_channels
from missing_physics.motion.estimate import Motion, estimate_motion
from missing_physics.motion.inverse import MotionDynamics, joint_inertia
from missing_physics.recordings import estimate_noise, sensors_of
from reference_model.evaluation.model import RobotModel
from robot_model import InputError, Recording, Robot

__all__ = ["make_dynamics", "most_samples"]

#: Most samples of one recording times joints squared: about 3 GB.
MOST_SAMPLES = 3_000_000


def most_samples(robot: Robot) -> int:
    """Most samples of one recording that a diagnosis of this robot accepts."""
    return MOST_SAMPLES // max(len(robot.moving_joints), 1) ** 2


def make_dynamics(
    robot: Robot, recordings: Sequence[Recording], *, cutoff: float | None = None
) -> tuple[MotionDynamics, ...]:
    """Motion and nominal dynamics of each recording, all with the same cut-off.

    Raises:
        InputError: the robot has coordinates that are not in joint channels, or a recording has too many
            samples or lacks a joint's position.
    """
    if robot.spherical_joints:
        raise InputError(
            f"robot '{robot.name}': the motion of spherical joint '{robot.spherical_joints[0].name}' is no "
            "channel of a recording; describe it by three revolute joints to diagnose the robot."
        )
    if not robot.moving_joints:
        raise InputError(
            f"robot '{robot.name}' has no moving joint, so there is nothing to diagnose; give the joint "
            "that moved a kind other than 'fixed'."
        )
    for recording in recordings:
        _require_memory(robot, recording)
    model = _model(robot)
    inertia = joint_inertia(model, np.array([joint.initial_position for joint in robot.moving_joints]))

    def motions_in(band: float | None) -> list[Motion]:
        return [
            estimate_motion(robot, one, inertia=inertia, noise=_noise(robot, one), cutoff=band)
            for one in recordings
        ]

    motions = motions_in(cutoff)
    lowest = min(motion.low_pass.cutoff for motion in motions)
    if any(motion.low_pass.cutoff > lowest for motion in motions):
        motions = motions_in(lowest)
    further = gyro_channels(robot, recordings)
    return tuple(MotionDynamics(model, motion, further) for motion in motions)


@lru_cache(maxsize=4)
def _model(robot: Robot) -> RobotModel:
    """Model of a robot, cached for all recordings, since code is generated for it."""
    return RobotModel(robot)


def _require_memory(robot: Robot, recording: Recording) -> None:
    """Refuse recordings whose derivatives by all inertial parameters would need too much memory."""
    joints = max(len(robot.moving_joints), 1)
    most = most_samples(robot)
    if len(recording) > most:
        raise InputError(
            f"{recording.source or 'the recording'} has {len(recording)} samples; a diagnosis of {joints} "
            f"joint{'s' if joints > 1 else ''} takes at most {most}: cut it or keep fewer samples per second."
        )


def _noise(robot: Robot, recording: Recording) -> Mapping[str, float]:
    """Noise by channel: what the recording states, else the robot's sensors, else an estimate."""
    stated = {}
    for s in sensors_of(robot, recording):  # a recording's own resolution is added where its noise is used
        rounding = 0.0 if s.channel in recording.resolution else s.resolution / np.sqrt(12.0)
        stated[s.channel] = float(np.hypot(s.noise, rounding))
    return {**estimate_noise(recording), **recording.noise, **stated}
