"""Recordings of a one-joint arm with known parameters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robot_model import Recording

ROBOT = """
name = "arm"
gravity = [0.0, 0.0, -9.81]

[base]
kind = "fixed"

[[links]]
name = "link"
mass = 2.0
center_of_mass = [0.3, 0.0, 0.0]
inertia = [0.01, 0.02, 0.02]

[[joints]]
name = "joint"
kind = "revolute"
parent = "base"
child = "link"
axis = [0.0, 0.0, 1.0]

[joints.actuator]
gear_ratio = 1.0
torque_limit = 50.0

[[sensors]]
channel = "joint.position"
noise = 1e-7

[[sensors]]
channel = "joint.torque"
noise = 0.01
"""
#: About the joint's axis, which is vertical: gravity does nothing.
INERTIA = 0.02 + 2.0 * 0.3**2
VISCOUS, COULOMB = 0.8, 0.5

Hidden = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def recorded(hidden: Hidden, *, seed: int, duration: float = 24.0, late: float = 0.0) -> Recording:
    """A recording at 200 Hz of which the torque is `late` [s], with a hidden torque of (time, q, v)."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 5e-3)
    phases, rates = random.uniform(0.0, 2.0 * np.pi, 4), 2.0 * np.pi * np.array([0.11, 0.23, 0.37, 0.61])
    sizes = np.array([0.9, 0.5, 0.3, 0.15])

    def motion(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angle = rates * at[:, None] + phases
        return np.sin(angle) @ sizes, np.cos(angle) @ (sizes * rates), -np.sin(angle) @ (sizes * rates**2)

    q, v, a = motion(time - late)
    torque = INERTIA * a + VISCOUS * v + COULOMB * np.sign(v) + hidden(time - late, q, v)
    position = motion(time)[0] + random.normal(0.0, 1e-7, time.size)
    channels = {"joint.position": position, "joint.torque": torque + random.normal(0.0, 0.01, time.size)}
    return Recording(time, channels, source=f"run {seed}")


def nothing(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    return np.zeros_like(time)


def spring(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    return 1.5 * position + 0.4


def weak_spring(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    return 0.003 * position


def drag(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """A fluid that the joint stirs."""
    return 0.4 * np.abs(velocity) * velocity


def asymmetric(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    return 0.15 * np.abs(velocity)


def wave(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    return 0.3 * np.cos(7.0 * position) - 0.2 * np.sin(7.0 * position)


def push(start: float) -> Hidden:
    """One second long."""
    return lambda time, position, velocity: np.where((time > start) & (time < start + 1.0), 1.0, 0.0)
