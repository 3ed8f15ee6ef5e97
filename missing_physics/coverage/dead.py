"""Dead channels: torques that are constant although the motion needs a drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from missing_physics.checks.actuation import actuator_torque
from missing_physics.coverage.needs import Needs
from missing_physics.motion.inverse import MotionDynamics
from robot_model import Recording, Robot

__all__ = ["dead_channels", "without_dead"]


def dead_channels(
    robot: Robot, recordings: Sequence[Recording], dynamics: Sequence[MotionDynamics]
) -> dict[str, str]:
    """Channels that cannot have driven the motion, with the reason as a clause.

    Args:
        robot: the nominal robot.
        recordings: as read.
        dynamics: of the nominal robot along each recording.
    """
    found: dict[str, str] = {}
    for recording, along in zip(recordings, dynamics):
        constant = {}
        for k, joint in enumerate(robot.moving_joints):
            channel, _ = actuator_torque(robot, recording, joint.name)
            if channel is not None and np.ptp(recording[channel][np.isfinite(recording[channel])]) == 0:
                constant[k] = channel
        needs = Needs.of(along) if constant else None
        for k, channel in constant.items():
            # A drive caused the motion if friction, springs and gravity explain less than half of the torque
            # that it needs. They explain nearly all of it at a joint that swings freely.
            if needs is not None and needs.undriven(k) > 1.0 - needs.undriven(k):
                value = float(np.nanmax(recording[channel]))
                found[channel] = (
                    f"{channel} is {value:.6g} throughout, which cannot cause this motion: the channel is "
                    "dead or not connected"
                )
    return found


def without_dead(recordings: Sequence[Recording], dead: Mapping[str, str]) -> tuple[Recording, ...]:
    """The recordings without the dead channels."""
    return tuple(
        replace(one, channels={name: y for name, y in one.channels.items() if name not in dead})
        for one in recordings
    )
