"""Random states of robots and the required generalised forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from robot_model import Robot, read_robot

__all__ = ["ROUNDING", "States", "random_states", "read_quietly"]

#: Relative to the largest force. Sums over some ten bodies of products of some ten factors, each rounded to
#: 1.1e-16, in another order in each program: a few hundred roundings, which mostly cancel.
ROUNDING = 1e-12


@dataclass(frozen=True)
class States:
    """N states: joint motion, shape (N, n) each, and the base's where it is free; forces, shape (N, rows)."""

    robot: Robot
    joints: tuple[str, ...]
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    base: BaseMotion | None
    force: np.ndarray


def read_quietly(path, **options) -> Robot:
    return read_robot(path, **options)[0]


def random_states(robot: Robot, *, samples: int = 4, seed: int = 0) -> States:
    """States far from any symmetry, with the inverse dynamics of the reference model, friction left out."""
    rng = np.random.default_rng(seed)
    model = RobotModel(robot)
    motion = rng.normal(size=(3, samples, len(model.joints)))
    base = None
    if model.free_base:
        attitude = rng.normal(size=(samples, 4))
        attitude /= np.linalg.norm(attitude, axis=1, keepdims=True)
        base = BaseMotion(attitude, *rng.normal(size=(4, samples, 3)))
    force = model.inverse_dynamics(*motion, base=base)
    return States(robot, tuple(model.joints), *motion, base, force)
