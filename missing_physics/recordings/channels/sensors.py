"""A robot's sensors for one recording: noise and resolution that the recording states take precedence.

The robot file states the noise of a sensor. Channels that were filtered, or for which a map states another
noise, differ from that.
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

    To be called before its values are changed: code that changes them also updates noise and steps.
    """
    there = [sensor for sensor in robot.sensors if sensor.channel in recording]
    noise = {sensor.channel: sensor.noise for sensor in there if sensor.noise > 0}
    steps = {sensor.channel: sensor.resolution for sensor in there if sensor.resolution > 0}
    return replace(
        recording, noise={**noise, **recording.noise}, resolution={**steps, **recording.resolution}
    )
