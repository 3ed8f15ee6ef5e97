"""An arm and a pendulum simulated by their equation of motion including friction."""

from __future__ import annotations

import numpy as np
from recorded_arm import COULOMB, INERTIA, VISCOUS

from robot_model import Recording

#: Of the integration; recorded is every tenth instant [s].
STEP = 5e-4
EVERY = 10


def commanded(limit: float, *, seed: int, duration: float = 24.0) -> Recording:
    """The arm of `recorded_arm` under PD control; of its commands no more than `limit` [N m] acts."""
    random = np.random.default_rng(seed)
    phases, rates = random.uniform(0.0, 2.0 * np.pi, 3), 2.0 * np.pi * np.array([0.13, 0.29, 0.47])
    time = np.arange(0.0, duration, STEP)
    target = np.sin(rates * time[:, None] + phases) @ np.array([0.8, 0.5, 0.35])
    wanted = np.gradient(target, time)
    position, velocity = np.empty_like(time), np.empty_like(time)
    command = np.empty_like(time)
    q, v = target[0], wanted[0]
    for i in range(time.size):
        u = 12.0 * (target[i] - q) + 2.5 * (wanted[i] - v)
        position[i], velocity[i], command[i] = q, v, u
        v = _slid(v + STEP / INERTIA * (float(np.clip(u, -limit, limit)) - VISCOUS * v), COULOMB / INERTIA)
        q += STEP * v
    noisy = position[::EVERY] + random.normal(0.0, 1e-7, position[::EVERY].size)
    channels = {"joint.position": noisy, "joint.torque": command[::EVERY]}
    return Recording(time[::EVERY], channels, source=f"run {seed}")


def decaying(stiffness: float, inertia: float, start: float, viscous: float, coulomb: float) -> Recording:
    """A pendulum that nothing drives: `inertia` q'' = -`stiffness` sin q less friction, for 20 s."""
    time = np.arange(0.0, 20.0, STEP)
    position, q, v = np.empty_like(time), start, 0.0
    for i in range(time.size):
        position[i] = q
        v = _slid(v - STEP / inertia * (stiffness * np.sin(q) + viscous * v), coulomb / inertia)
        q += STEP * v
    random = np.random.default_rng(int(100 * start))
    noisy = position[::EVERY] + random.normal(0.0, 1e-6, position[::EVERY].size)
    channels = {"joint.position": noisy, "joint.torque": np.zeros(noisy.size)}
    return Recording(time[::EVERY], channels, source=f"from {start}")


def _slid(velocity: float, friction: float) -> float:
    """A velocity after dry friction of one implicit step, which stops it and never reverses it."""
    return float(np.sign(velocity) * max(abs(velocity) - STEP * friction, 0.0))
