"""Torques that are constant although the motion takes a drive: dead channels, which say nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from missing_physics.checks.actuation import actuator_torque
from missing_physics.diagnosis.coverage.needs import Needs
from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from robot_model import Recording, Robot

__all__ = ["dead_channels", "without_dead"]


def dead_channels(
    robot: Robot, recordings: Sequence[Recording], dynamics: Sequence[MotionDynamics]
) -> dict[str, str]:
    """Channels that cannot have driven the motion, with what is wrong with them, as a clause.

    Args:
        robot: the nominal robot.
        recordings: as read.
        dynamics: of the nominal robot along each.
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
            # A drive made the motion where friction, springs and gravity leave more of the torque that it
            # takes than they make. A joint that swings freely leaves next to nothing.
            if needs is not None and needs.undriven(k) > 1.0 - needs.undriven(k):
                value = float(np.nanmax(recording[channel]))
                found[channel] = (
                    f"{channel} is {value:.6g} throughout, which cannot cause this motion: the channel is "
                    "dead or not connected"
                )
    return found


def without_dead(recordings: Sequence[Recording], dead: Mapping[str, str]) -> tuple[Recording, ...]:
    """The recordings without these channels."""
    return tuple(
        replace(one, channels={name: y for name, y in one.channels.items() if name not in dead})
        for one in recordings
    )
