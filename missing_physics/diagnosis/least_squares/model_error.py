"""How good the model of links that bend is: what is smaller is neither a mismatch nor an effect.

Links are described by a few modes whose motion enters to first order. Against geometrically exact beams, and
with the vibration estimated from noisy channels, the torques of robots in which nothing is missing came out
right to 0.03 to 0.3 % of their rms (`docs/regression.md`); no real link is described better.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.standard import MODEL_ERROR

__all__ = ["accuracy", "within_accuracy"]


def accuracy(problem: Problem) -> NDArray[np.float64]:
    """Error of what is predicted of each output in its unit, shape (m,); nothing where no link bends."""
    if not problem.robot.flexible_links:
        return np.zeros(len(problem.outputs))
    return np.asarray(MODEL_ERROR * np.sqrt(np.mean(problem.measured**2, axis=0)))


def within_accuracy(explanation: Explanation, without: Explanation) -> bool:
    """Whether what an explanation does beyond another is less than `accuracy` at every output."""
    problem, view, used = explanation.problem, explanation.view, explanation.problem.usable
    rows = np.maximum(view.weight(problem)[view.rows][:, used].sum(axis=0), 1.0)
    removed = (without.energies - explanation.energies) * view.scale[used] ** 2 / rows
    return bool(np.all(removed < accuracy(problem)[used] ** 2))
