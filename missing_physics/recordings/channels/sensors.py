"""A robot's sensors for one recording: noise and resolution stated in the recording take precedence.

The robot file states the noise of a sensor. Filtered channels, or those with another noise in a map, differ
from that.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from robot_model import Recording, Robot, Sensor

__all__ = ["sensor_of", "sensors_of", "with_sensors"]


def sensor_of(robot: Robot, recording: Recording, channel: str) -> Sensor | None:
    """The robot's sensor of a channel, with noise and resolution from the recording if stated there.

    Returns:
        None if the robot has no sensor of this channel.
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
    """The recording with noise and resolution of the robot's sensors, where it states none itself.

    To be called before its values are changed: code that changes them also updates noise and resolution.
    """
    recorded = [sensor for sensor in robot.sensors if sensor.channel in recording]
    noise = {sensor.channel: sensor.noise for sensor in recorded if sensor.noise > 0}
    steps = {sensor.channel: sensor.resolution for sensor in recorded if sensor.resolution > 0}
    return replace(
        recording, noise={**noise, **recording.noise}, resolution={**steps, **recording.resolution}
    )
