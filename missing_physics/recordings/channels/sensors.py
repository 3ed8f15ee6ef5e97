"""A robot's sensors as they stand for one recording: what it states of its own numbers comes first.

The robot file says how a sensor scatters. Numbers that went through a filter, or of which a map states
something else, scatter otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from robot_model import Recording, Robot, Sensor

__all__ = ["sensor_of", "sensors_of", "with_sensors"]


def sensor_of(robot: Robot, recording: Recording, channel: str) -> Sensor | None:
    """The robot's sensor of a channel, with the noise and the steps that the recording states, if it does.

    Returns:
        None where the robot has no sensor of this channel.
    """
    sensor = robot.sensor(channel)
    if sensor is None:
        return None
    noise = recording.noise.get(channel, sensor.noise)
    resolution = recording.resolution.get(channel, sensor.resolution)
    return sensor.model_copy(update={"noise": noise, "resolution": resolution})


def sensors_of(robot: Robot, recording: Recording) -> Iterator[Sensor]:
    """Each of the robot's sensors, see `sensor_of`."""
    for sensor in robot.sensors:
        own = sensor_of(robot, recording, sensor.channel)
        assert own is not None
        yield own


def with_sensors(robot: Robot, recording: Recording) -> Recording:
    """The recording with noise and steps of the robot's sensors stated, where it states none itself.

    Before its numbers are changed: what changes them knows what becomes of both.
    """
    there = [sensor for sensor in robot.sensors if sensor.channel in recording]
    noise = {sensor.channel: sensor.noise for sensor in there if sensor.noise > 0}
    steps = {sensor.channel: sensor.resolution for sensor in there if sensor.resolution > 0}
    return replace(
        recording, noise={**noise, **recording.noise}, resolution={**steps, **recording.resolution}
    )
