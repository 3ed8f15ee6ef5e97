"""Recordings from closed-form motions with exactly known torques."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_model.evaluation.model import RobotModel
from robot_model import Recording, Robot, load_robot

Array = NDArray[np.float64]
#: Torque that is added to the robot's own: of time, position, velocity, acceleration, each of shape (N, n).
Extra = Callable[[Array, Array, Array, Array], Array]


@dataclass(frozen=True)
class Sines:
    """A sum of sines with its exact derivatives; amplitudes [rad or m], frequencies [Hz]."""

    amplitudes: tuple[float, ...]
    frequencies: tuple[float, ...]
    phases: tuple[float, ...]
    centre: float = 0.0

    def __call__(self, time: Array) -> tuple[Array, Array, Array]:
        w = 2 * np.pi * np.array(self.frequencies)
        angle = np.outer(time, w) + np.array(self.phases)
        a = np.array(self.amplitudes)
        return self.centre + np.sin(angle) @ a, np.cos(angle) @ (a * w), -np.sin(angle) @ (a * w**2)


AXIS = (Sines((0.06, 0.035, 0.012), (0.15, 0.37, 0.83), (0.0, 1.3, 2.1), centre=0.2),)
ARM = (
    Sines((0.5, 0.3, 0.1), (0.17, 0.41, 0.93), (0.0, 0.9, 2.2)),
    Sines((0.6, 0.35, 0.12), (0.21, 0.47, 1.07), (1.0, 0.2, 2.9)),
)


def bare(name: str, *, noise: bool = False) -> Robot:
    """A shipped robot without its effects, and without stated sensor noise unless `noise`."""
    robot = load_robot(name)
    sensors = robot.sensors if noise else ()
    return robot.model_copy(update={"effects": (), "sensors": sensors})


def recorded(
    robot: Robot,
    motions: Sequence[Sines],
    extra: Extra | None = None,
    *,
    duration: float = 12.0,
    rate: float = 250.0,
    seed: int | None = None,
    shift: ArrayLike = 0.0,
    start: float = 0.0,
) -> Recording:
    """What `robot` needs to move so, plus `extra`; with the noise of its sensors when a seed is given.

    Args:
        shift: delay of each joint's position sensor [s].
        start: first instant [s]; the motion does not depend on it.
    """
    time = np.arange(round(duration * rate)) / rate
    state = tuple(np.column_stack(parts) for parts in zip(*(motion(time) for motion in motions)))
    torque = RobotModel(robot).inverse_dynamics(*state)
    if extra is not None:
        torque = torque + extra(time[:, None], *state)
    delays = np.broadcast_to(np.asarray(shift, dtype=float), (len(motions),))
    channels: dict[str, Array] = {}
    for k, (joint, motion, delay) in enumerate(zip(robot.moving_joints, motions, delays)):
        channels[f"{joint.name}.position"] = motion(time - delay)[0]
        channels[f"{joint.name}.torque"] = torque[:, k]
    if seed is not None:
        channels = _noisy(robot, channels, np.random.default_rng(seed))
    return Recording(time + start, channels, "made by formula")


def _noisy(robot: Robot, channels: dict[str, Array], chance: np.random.Generator) -> dict[str, Array]:
    result = {}
    for name, values in channels.items():
        sensor = robot.sensor(name)
        result[name] = values + chance.standard_normal(values.size) * (sensor.noise if sensor else 0.0)
    return result
