"""Measured channels from exact ones: faults, then white noise, then resolution."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from exudyn_model.effects.sensors import SensorFault
from robot_model import InputError, Recording, Robot, Sensor, nearest

__all__ = ["check_sensors", "sensed"]

Array = NDArray[np.float64]


def sensed(
    robot: Robot, exact: Recording, *, faults: Sequence[tuple[str, SensorFault]], seed: int
) -> Recording:
    """The recording of the sensors of `robot`; without sensors, all channels of the described robot,
    without noise.

    Args:
        robot: with its `sensors`.
        exact: every channel without noise.
        faults: channel and fault of its sensor, in the order of the file.
        seed: each channel's noise depends on it and on the channel's name only.
    """
    described = [name for name in exact if _is_described(robot, name)]
    sensors = robot.sensors or tuple(Sensor(channel=name, noise=0.0, resolution=0.0) for name in described)
    values = {sensor.channel: exact[sensor.channel] for sensor in sensors}
    for channel, fault in faults:
        values[channel] = fault.applied(exact.time, values[channel])
    measured = {sensor.channel: _sampled(sensor, values[sensor.channel], seed) for sensor in sensors}
    goals = {name: exact[name] for name in exact if name.endswith(".reference_position")}
    return Recording(
        exact.time,
        {**goals, **measured},
        source=exact.source,
        noise={sensor.channel: sensor.noise for sensor in sensors if sensor.noise > 0},
        resolution={sensor.channel: sensor.resolution for sensor in sensors if sensor.resolution > 0},
    )


def check_sensors(robot: Robot, channels: Sequence[str], faulty: Sequence[str]) -> None:
    """Raise `InputError` for a sensor of an unknown channel or a fault of an unmeasured one."""
    known = list(channels)
    for sensor in robot.sensors:
        if sensor.channel not in known:
            raise InputError(
                f"robot '{robot.name}': the Exudyn engine gives no channel '{sensor.channel}'"
                f"{nearest(sensor.channel, known)}."
            )
    measured = [sensor.channel for sensor in robot.sensors] or known
    for channel in faulty:
        if channel not in measured:
            raise InputError(
                f"robot '{robot.name}': a sensor effect sits at '{channel}', which no sensor measures"
                f"{nearest(channel, measured)}."
            )


def _is_described(robot: Robot, channel: str) -> bool:
    """Whether the channel belongs to the description; effects may have added bodies and modes."""
    place, quantity = channel.split(".")[:2]
    bends = {link.name: link.flexible for link in robot.links}
    if place in bends:
        return quantity != "modal_coordinate" or bends[place]
    return place in ("base", "robot") or place in [joint.name for joint in robot.joints]


def _sampled(sensor: Sensor, values: Array, seed: int) -> Array:
    if sensor.noise > 0:
        generator = np.random.default_rng([seed, zlib.crc32(sensor.channel.encode())])
        values = values + generator.normal(0.0, sensor.noise, len(values))
    return np.round(values / sensor.resolution) * sensor.resolution if sensor.resolution > 0 else values
