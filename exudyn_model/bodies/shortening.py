"""Shortening of a beam by bending: half of the squared slopes, integrated from its root."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.beam import Shapes
from robot_model import Beam

__all__ = ["shortening"]

Array = NDArray[np.float64]

#: Points and weights of Gauss' rule on 0 to 1: exact for the squares of quadratic slopes.
POINTS = 0.5 + 0.5 * np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0])
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18


def shortening(beam: Beam, shapes: Shapes) -> Array:
    """B_k: bending moves node k by -1/2 x^T B_k x along the axis, shape (N, s, s) [1/(m kg)].

    B_k is the integral of v'^T v' + w'^T w' along the beam, of cubics between the nodes.
    """
    h = beam.length / beam.elements
    moves = np.einsum("ab,nas->nbs", beam.axes, shapes.translations)
    turns = np.einsum("ab,nas->nbs", beam.axes, shapes.rotations)
    found = np.zeros((beam.elements + 1, moves.shape[2], moves.shape[2]))
    for k in range(beam.elements):
        found[k + 1] = found[k]
        for t, weight in zip(POINTS, WEIGHTS):
            # of the cubic between two nodes, by displacements and slopes there
            ends = 6 * t * (1 - t) / h, 1 - 4 * t + 3 * t * t, 3 * t * t - 2 * t
            for move, slope in ((moves[:, 1], turns[:, 2]), (moves[:, 2], -turns[:, 1])):
                tilt = ends[0] * (move[k + 1] - move[k]) + ends[1] * slope[k] + ends[2] * slope[k + 1]
                found[k + 1] += weight * h * np.outer(tilt, tilt)
    return found
