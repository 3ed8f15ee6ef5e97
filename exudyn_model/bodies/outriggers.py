"""Rotary inertia of a node as points around it, for a mesh that has displacements only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.beam import Node
from robot_model import InputError

__all__ = ["outriggers"]

Array = NDArray[np.float64]

#: Fraction of a node's mass in each of the six points around it: with 1/12 half of it stays at the node.
SHARE = 1 / 12
#: Rounding error of a zero moment, relative to the largest one.
NO_MOMENT = 1e-12


def outriggers(node: Node) -> tuple[Array, float]:
    """Arms of six points around a node, shape (6, 3) [m], and the mass of each [kg].

    Two at +-a_i along each principal axis give second moments 2 mu a_i^2 = (J_j + J_k - J_i) / 2.
    """
    moments, axes = np.linalg.eigh(node.inertia)
    second = 0.5 * moments.sum() - moments
    if second.min() < -NO_MOMENT * max(float(moments[-1]), 1.0):
        raise InputError("a tip's moments of inertia break the triangle inequality; no body has such.")
    mass = SHARE * node.mass
    if mass == 0:
        mass = float(moments.sum())  # of a massless node with inertia; its own point then subtracts it
    if mass == 0:
        return np.zeros((6, 3)), 0.0
    arms = (axes * np.sqrt(np.maximum(second, 0.0) / (2 * mass))).T
    return np.array([sign * arm for arm in arms for sign in (1.0, -1.0)]), mass
