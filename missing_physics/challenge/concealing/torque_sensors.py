"""Sensors of torque: their noise for a case, and noise as large as what an effect does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.challenge.torques.along import ArmAlong
from robot_model import EffectUse, Recording, Robot, Sensor

__all__ = ["as_noisy_as", "effect_size", "louder", "quiet", "torque_sensors"]

Array = NDArray[np.float64]

#: What varies by less, relative to the largest, is constant.
ROUNDING = 1e-9
#: What does less than this share of the sensor's noise does nothing here, and is no measure of noise.
FAINT = 0.05


def torque_sensors(robot: Robot) -> tuple[Sensor, ...]:
    """Those of the joints' torques."""
    return tuple(sensor for sensor in robot.sensors if sensor.channel.endswith(".torque"))


def louder(robot: Robot, factor: float) -> Robot:
    """The noise of its torque channels times `factor`; their resolution stays."""
    torques = torque_sensors(robot)
    changed = [s.model_copy(update={"noise": factor * s.noise}) if s in torques else s for s in robot.sensors]
    return robot.model_copy(update={"sensors": tuple(changed)})


def quiet(robot: Robot) -> Robot:
    """Torque channels without noise and rounding."""
    exact, torques = {"noise": 0.0, "resolution": 0.0}, torque_sensors(robot)
    changed = [s.model_copy(update=exact) if s in torques else s for s in robot.sensors]
    return robot.model_copy(update={"sensors": tuple(changed)})


def as_noisy_as(robot: Robot, use: EffectUse, ratio: float, exact: Recording) -> Robot:
    """Torque sensors whose noise, where an effect sits, is `ratio` times what it does there, or would do.

    Args:
        robot: without the effect.
        use: the effect.
        ratio: of the noise to the effect's size.
        exact: a recording of the robot without sensors.
    """
    along = ArmAlong(robot, exact)
    size = effect_size(along.part(use)[:, along.joints.index(use.at)])
    now = robot.sensor(f"{use.at}.torque")
    if now is None or now.noise == 0 or size < FAINT * now.noise:
        return robot
    factor = ratio * size / now.noise
    torques = torque_sensors(robot)
    sensors = tuple(
        s.model_copy(update={"noise": s.noise * factor, "resolution": s.resolution * factor})
        if s in torques
        else s
        for s in robot.sensors
    )
    return robot.model_copy(update={"sensors": sensors})


def effect_size(part: Array) -> float:
    """rms about its mean of what an effect does; of one that is constant but for rounding, the rms."""
    varying = float(np.sqrt(np.mean((part - part.mean()) ** 2)))
    if varying < ROUNDING * float(np.abs(part).max()):
        return float(np.sqrt(np.mean(part**2)))
    return varying
