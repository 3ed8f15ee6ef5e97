"""Torque sensors: their noise in a case, and noise of the size of an effect."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.challenge.torques.along import ArmAlong
from robot_model import EffectUse, Recording, Robot, Sensor

__all__ = ["effect_size", "torque_sensors", "with_noise_factor", "with_noise_of_effect", "without_noise"]

Array = NDArray[np.float64]

#: Values that vary by less, relative to the largest, are constant.
ROUNDING = 1e-9
#: An effect below this fraction of the sensor's noise is negligible and does not set the noise.
FAINT = 0.05


def torque_sensors(robot: Robot) -> tuple[Sensor, ...]:
    """Torque sensors of the joints."""
    return tuple(sensor for sensor in robot.sensors if sensor.channel.endswith(".torque"))


def with_noise_factor(robot: Robot, factor: float) -> Robot:
    """`robot` with the noise of its torque channels times `factor`; their resolution stays."""
    torques = torque_sensors(robot)
    changed = [s.model_copy(update={"noise": factor * s.noise}) if s in torques else s for s in robot.sensors]
    return robot.model_copy(update={"sensors": tuple(changed)})


def without_noise(robot: Robot) -> Robot:
    """`robot` with torque channels without noise and rounding."""
    exact, torques = {"noise": 0.0, "resolution": 0.0}, torque_sensors(robot)
    changed = [s.model_copy(update=exact) if s in torques else s for s in robot.sensors]
    return robot.model_copy(update={"sensors": tuple(changed)})


def with_noise_of_effect(robot: Robot, use: EffectUse, ratio: float, exact: Recording) -> Robot:
    """`robot` with torque noise `ratio` times as large as an effect at its joint.

    Args:
        robot: robot without the effect.
        use: the effect.
        ratio: ratio of the noise to the effect's torque.
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
    """Standard deviation of an effect's torque; the rms if it is constant up to rounding."""
    varying = float(np.sqrt(np.mean((part - part.mean()) ** 2)))
    if varying < ROUNDING * float(np.abs(part).max()):
        return float(np.sqrt(np.mean(part**2)))
    return varying
