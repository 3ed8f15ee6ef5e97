"""Recorded against simulated channels, in units of what a sensor is said to scatter.

Rounding to a sensor's resolution is no white noise where little else moves the last digit, so that what is
compared is the mean that rounding of a noisy value gives (Widrow and Kollar, Quantization Noise (2008),
ch. 4).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from reference_model.sensing import measure
from reference_model.simulation import simulate
from robot_model import Recording, Robot, Sensor

__all__ = ["as_measured", "difference", "known_noise", "measured", "rounded_mean", "spread"]

Array = NDArray[np.float64]

#: With noise above this part of the resolution the first terms of the mean's Fourier series are exact to
#: 1e-9; below it the value is as good as rounded.
DITHER, TERMS = 0.1, 10


def rounded_mean(value: Array, sensor: Sensor) -> Array:
    """Mean of what a sensor with noise and resolution says of a true value, shape (N,).

    The error of rounding is a sawtooth; Gaussian noise takes its k-th harmonic down by
    exp(-2 (pi k noise / resolution)^2) (Widrow and Kollar (2008), ch. 4).
    """
    if sensor.resolution <= 0:
        return value
    steps, spread = value / sensor.resolution, sensor.noise / sensor.resolution
    if spread < DITHER:
        return np.asarray(np.round(steps) * sensor.resolution)
    error = np.zeros_like(steps)
    for k in range(1, TERMS + 1):
        fade = (-1) ** k / (np.pi * k) * np.exp(-2 * (np.pi * k * spread) ** 2)
        error += fade * np.sin(2 * np.pi * k * steps)
    return np.asarray((steps + error) * sensor.resolution)


def difference(sensor: Sensor, recorded: Array, true: Array) -> Array:
    """Recorded minus simulated in units of the stated noise, rounding included."""
    return np.asarray((recorded - rounded_mean(true, sensor)) / spread(sensor))


def spread(sensor: Sensor) -> float:
    """Standard deviation of what a sensor adds, rounding included, in the unit of its channel."""
    return float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12.0)))


def known_noise(sensor: Sensor) -> bool:
    """Whether it is stated how far a sensor's values scatter."""
    return sensor.noise > 0 or sensor.resolution > 0


def measured(recording: Recording) -> Iterator[str]:
    """Channels of sensors that a run of a robot tells: no references, and no temperatures."""
    return (name for name in recording if not name.endswith((".reference_position", ".temperature")))


def as_measured(robot: Robot) -> Recording:
    """What the robot's sensors would say without noise and rounding; references besides.

    Raises:
        InputError: the robot cannot be simulated.
    """
    exact = tuple(s.model_copy(update={"noise": 0.0, "resolution": 0.0}) for s in robot.sensors)
    true = simulate(robot, sensors=False)
    clean = robot.model_copy(update={"sensors": exact})
    return measure(clean, true.time, true.channels, seed=0, source=true.source)
