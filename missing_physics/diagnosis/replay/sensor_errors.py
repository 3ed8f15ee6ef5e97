"""Recorded against simulated channels, in units of what a sensor is said to scatter.

Rounding to a sensor's resolution is no white noise where little else moves the last digit, so that what is
compared is the mean that rounding of a noisy value gives (Widrow and Kollar, Quantization Noise (2008),
ch. 4).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference_model.plant.sensing import measure
from reference_model.simulation import simulate
from reference_model.steppers.effort import Effort
from robot_model import NoController, Recording, Robot, Sensor

__all__ = [
    "as_measured",
    "dear",
    "difference",
    "known_noise",
    "measured",
    "rounded_mean",
    "spread",
    "steps_left",
]

Array = NDArray[np.float64]

#: With noise above this part of the resolution the first terms of the mean's Fourier series are exact to
#: 1e-9; below it the value is as good as rounded.
DITHER, TERMS = 0.1, 10
#: Robots of more joints, or with links that bend, and those with sampled controllers are run at tolerances
#: that their sensors ask for.
FEW_JOINTS = 4
#: Relative tolerances with which no channel errs by a tenth of its noise where encoders scatter by `USUAL`:
#: of CVODES along a continuous controller, of single steps between a sampled one's commands. The absolute
#: ones are a hundredth of them.
CONTINUOUS, SAMPLED, USUAL = 1e-7, 1e-5, 2e-6
#: Of such steps of other robots: in drawn cases they err by a thousandth of the noise at most, and take a
#: third of the time that 1e-6 takes where something is stiff; with 1e-4 they erred by a fiftieth.
FINER = 3e-5


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


def steps_left(noise: float, resolution: float) -> float:
    """rms by which the mean of what a sensor says differs from the true value, over all true values.

    What noise, its standard deviation, leaves of the sawtooth of rounding (`rounded_mean`).
    """
    if resolution <= 0:
        return 0.0
    if noise < DITHER * resolution:
        return float(resolution / np.sqrt(12.0))
    k = np.arange(1, TERMS + 1)
    return float(
        resolution
        * np.sqrt(0.5 * np.sum((np.exp(-2 * (np.pi * k * noise / resolution) ** 2) / (np.pi * k)) ** 2))
    )


def difference(sensor: Sensor, recorded: Array, true: Array) -> Array:
    """Recorded minus simulated in units of the stated noise, rounding included."""
    return np.asarray((recorded - rounded_mean(true, sensor)) / spread(sensor))


def spread(sensor: Sensor) -> float:
    """Standard deviation of what a sensor adds, rounding included, in the unit of its channel."""
    return float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12.0)))


def known_noise(sensor: Sensor) -> bool:
    """Whether it is stated how far a sensor's values scatter."""
    return sensor.noise > 0 or sensor.resolution > 0


def dear(robot: Robot) -> bool:
    """Whether a run of the robot takes many operations at each instant."""
    return bool(robot.flexible_links) or len(robot.moving_joints) > FEW_JOINTS


def measured(recording: Recording) -> Iterator[str]:
    """Channels of sensors that a run of a robot tells: no references, and no temperatures."""
    return (name for name in recording if not name.endswith((".reference_position", ".temperature")))


def as_measured(robot: Robot, effort: Effort | None = None) -> Recording:
    """What the robot's sensors would say without noise and rounding; references besides.

    Args:
        effort: to which the run adds what it took.

    Raises:
        InputError: the robot cannot be simulated.
    """
    exact = tuple(s.model_copy(update={"noise": 0.0, "resolution": 0.0}) for s in robot.sensors)
    true = simulate(robot, sensors=False, effort=effort, any_bodies=True, **_settings(robot))
    clean = robot.model_copy(update={"sensors": exact})
    return measure(clean, true.time, true.channels, seed=0, source=true.source)


def _settings(robot: Robot) -> dict[str, Any]:
    """Integrator and tolerances for what is compared with noise."""
    sampled = not isinstance(robot.controller, NoController) and robot.controller.sample_time > 0
    if not (dear(robot) or sampled):
        return {}
    places = [sensor for sensor in robot.sensors if sensor.channel.endswith(".position")]
    finest = min((spread(sensor) for sensor in places if known_noise(sensor)), default=USUAL)
    usual = CONTINUOUS if not sampled else SAMPLED if dear(robot) else FINER
    rtol = usual * min(1.0, finest / USUAL)
    return {"rtol": rtol, "atol": rtol / 100, "integrator": "rosenbrock" if sampled else "implicit"}
