"""Recordings of two engines that never ran: a flexible robot in closed form, with errors of known size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.reporting.crosscheck import Comparison, compare
from robot_model import Recording, Robot, load_robot

__all__ = ["ERROR", "comparison", "recordings", "robot"]

Array = NDArray[np.float64]

#: Error of the pretended second engine in every channel's unit; its coarse run has four times it.
ERROR = 1e-6


def robot() -> Robot:
    return load_robot("flexible_space_robot")


def _truth(time: Array) -> dict[str, Array]:
    angle = 0.4 * np.sin(1.3 * time)
    turn = 0.05 * (1 - np.cos(0.7 * time))
    zero = np.zeros_like(time)
    channels = {f"base.position.{axis}": 0.1 * (k + 1) * turn for k, axis in enumerate("xyz")}
    channels |= dict(zip([f"base.attitude.{a}" for a in "wxyz"], (np.cos(turn), zero, zero, np.sin(turn))))
    for k, joint in enumerate(("joint1", "joint2")):
        channels[f"{joint}.position"] = (k + 1) * angle
        channels[f"{joint}.velocity"] = (k + 1) * 0.4 * 1.3 * np.cos(1.3 * time)
        channels[f"{joint}.torque"] = 20 * np.sin(1.3 * time + k)
        channels[f"{joint}.radial_force"] = 50 + 5 * np.cos(2 * time)
    for k, axis in enumerate("xyz"):
        channels[f"link2.tip_deflection.{axis}"] = 1e-3 * k * np.sin(9 * time)
    channels["robot.energy"] = 1 + time
    return channels


def recordings(samples: int = 801, rate: float = 200.0) -> tuple[Recording, Recording, Recording]:
    """The truth, the second engine's, and the second engine's coarser one at every other instant."""
    time = np.arange(samples) / rate
    shape = np.sin(3 * time) + 0.5
    truth = _truth(time)
    fine = {name: y + ERROR * shape for name, y in truth.items()}
    coarse = {name: (y + 4 * ERROR * shape)[::2] for name, y in truth.items()}
    return (
        Recording(time, truth, "one"),
        Recording(time, fine, "other"),
        Recording(time[::2], coarse, "other, coarser"),
    )


def comparison(samples: int = 801) -> Comparison:
    first, second, coarse = recordings(samples)
    return compare(robot(), first, second, [(second, coarse)])
