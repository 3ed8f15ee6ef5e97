"""Measured channels from true ones."""

from __future__ import annotations

import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from reference_model.effects.catalogue import used_effects
from reference_model.plant.acting import sensor_effects
from robot_model import InputError, Recording, Robot, Sensor, nearest

__all__ = ["measure"]

Array = NDArray[np.float64]


def measure(robot: Robot, time: Array, channels: Mapping[str, Array], *, seed: int, source: str) -> Recording:
    """The recording of the robot's sensors: effects of the sensor, then noise, then resolution.

    Args:
        robot: with its `sensors`; none means every channel of the described robot, without noise.
        time: [s], shape (N,).
        channels: true values by native name, shape (N,) each.
        seed: of the noise.
        source: of the recording, for people.

    Raises:
        InputError: a sensor or a sensor effect at a channel that does not exist or is not measured.
    """
    sensors = robot.sensors or tuple(
        Sensor(channel=name, noise=0.0, resolution=0.0) for name in channels if _is_described(robot, name)
    )
    values = {sensor.channel: _true(robot, sensor.channel, channels) for sensor in sensors}
    for effect, used in sensor_effects(used_effects(robot)):
        if used.at not in values:
            raise InputError(
                f"robot '{robot.name}', effect '{effect.id}': no sensor measures '{used.at}'"
                f"{nearest(used.at, values)}."
            )
        values[used.at] = effect.apply(time, values[used.at], used.parameters)
    noisy = {sensor.channel: _sampled(sensor, values[sensor.channel], seed) for sensor in sensors}
    references = {name: y for name, y in channels.items() if name.endswith(".reference_position")}
    return Recording(
        time,
        {**references, **noisy},
        source=source,
        noise={sensor.channel: sensor.noise for sensor in sensors if sensor.noise > 0},
        resolution={sensor.channel: sensor.resolution for sensor in sensors if sensor.resolution > 0},
    )


def _is_described(robot: Robot, channel: str) -> bool:
    """Whether the channel belongs to the description, not only to an effect."""
    place, quantity = channel.split(".")[:2]
    links = {link.name: link.flexible for link in robot.links}
    known = {"base", "robot", *links, *(joint.name for joint in robot.joints)}
    return place in known and (quantity != "modal_coordinate" or links[place])


def _true(robot: Robot, channel: str, channels: Mapping[str, Array]) -> Array:
    try:
        return channels[channel]
    except KeyError:
        raise InputError(
            f"robot '{robot.name}': a simulation has no channel '{channel}'{nearest(channel, channels)}."
        ) from None


def _sampled(sensor: Sensor, values: Array, seed: int) -> Array:
    """Values with white noise, rounded to the resolution."""
    if sensor.noise > 0:
        stream = np.random.default_rng([seed, zlib.crc32(sensor.channel.encode())])
        values = values + sensor.noise * stream.standard_normal(len(values))
    return np.round(values / sensor.resolution) * sensor.resolution if sensor.resolution > 0 else values
