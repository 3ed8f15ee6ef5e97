"""Gyros on a free base, which reveal whether anything but the joints turns it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings import noise_of, sensor_of
from robot_model import Recording, Robot

__all__ = ["covered", "gyro_channels", "gyro_noise"]

#: A gyro's channels in the order of the axes.
GYRO = tuple(f"base.angular_velocity.{axis}" for axis in "xyz")
#: A gap is longer than this many samples of a channel's own clock.
GAP = 1.5


def gyro_channels(robot: Robot, recordings: Sequence[Recording]) -> tuple[str, ...]:
    """The gyro channels that all of the recordings have; none for a fixed base."""
    if robot.base.kind != "free":
        return ()
    return tuple(
        channel
        for channel in GYRO
        if all(channel in r and covered(r, channel).sum() > 0.5 * len(r) for r in recordings)
    )


def gyro_noise(robot: Robot, recording: Recording, channel: str, cutoff: float) -> float:
    """rms below `cutoff` [Hz] of a gyro's white noise: from the robot or the recording, else an estimate."""
    sensor = sensor_of(robot, recording, channel)
    if sensor is None:
        found = noise_of(recording, channel)
    else:
        found = float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12.0)))
    time = recording.time[np.isfinite(recording[channel])]
    return float(found * np.sqrt(min(1.0, 2.0 * cutoff * float(np.median(np.diff(time))))))


def covered(recording: Recording, channel: str) -> NDArray[np.bool_]:
    """Mask of the instants at which a channel, maybe with a slower clock, has no gap, shape (N,)."""
    good = np.flatnonzero(np.isfinite(recording[channel]))
    inside = np.zeros(len(recording), dtype=bool)
    if good.size > 1:
        steps = np.diff(good)
        inside[good[0] : good[-1]] = np.repeat(steps <= GAP * np.median(steps), steps)
    inside[good] = True
    return inside
