"""The scale of recorded torques relative to the robot file, and the evidence from it.

A scale s of each joint is estimated by least squares. Its error includes the scatter between blocks of rows
(jackknife) and that of an imperfect model: the residual may have a correlation of `ALIGNED` with the column
of interest. If the channel is c times the torque, s is c times the error factors of the robot file's masses
and gains, one common to all joints and one for each joint, whose logarithms have Student distributions. With
a small probability it has any value (`LOADED`: a counterbalance, a cable, a motion that hardly determines
it).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["Scale", "log_absence", "log_evidence", "scale_of"]

Array = NDArray[np.float64]

#: Correlation of the residual with a column below which it is no evidence for that column.
ALIGNED = 0.1
#: Widths of the logarithms of the factors, and degrees of freedom of their distributions.
COMMON, OWN, FREEDOM = 0.35, 0.25, 4.0
#: Probability that a joint carries a load that is not in the file, and the relative magnitude of that load.
LOADED, LOAD = 0.1, 1.0
#: Blocks of rows.
BLOCKS = 8
#: Nodes of the integrals, and their range [widths].
NODES, REACH = 81, 12.0
#: A column counts as a combination of others if its independent part is smaller than this (squared).
RANK = 1e-10


@dataclass(frozen=True)
class Scale:
    """Factor of a column in one joint's torque.

    Attributes:
        value: estimate.
        error: its standard deviation.
        left: residual energy with the column [N^2 m^2].
        without: residual energy without the column [N^2 m^2].
    """

    value: float
    error: float
    left: float
    without: float


def scale_of(column: Array, others: Array, torque: Array) -> Scale | None:
    """The factor of `column` in `torque` in addition to `others`; None if these explain the column.

    Args:
        column: shape (K,).
        others: shape (K, m).
        torque: shape (K,).
    """
    columns = np.column_stack([column, others])
    size = np.linalg.norm(columns, axis=0)
    if not size[0] or not np.any(torque):
        return None
    columns = columns / np.where(size > 0.0, size, 1.0)
    own = columns[:, 0] - columns[:, 1:] @ _solved(columns[:, 1:], columns[:, 0])
    if float(own @ own) < RANK:
        return None
    found = _solved(columns, torque)
    left = torque - columns @ found
    without = torque - columns[:, 1:] @ _solved(columns[:, 1:], torque)
    blocks = np.array_split(np.arange(len(torque)), BLOCKS)
    grams = [columns[rows].T @ columns[rows] for rows in blocks]
    rights = [columns[rows].T @ torque[rows] for rows in blocks]
    gram, right = sum(grams), sum(rights)
    apart = [np.linalg.lstsq(gram - g, right - r, rcond=RANK)[0][0] for g, r in zip(grams, rights)]
    scatter = (BLOCKS - 1) / BLOCKS * float(np.sum((np.array(apart) - np.mean(apart)) ** 2))
    energy = float(left @ left)
    model = ALIGNED**2 * energy / float(own @ own)
    return Scale(
        float(found[0] / size[0]),
        float(np.sqrt(scatter + model) / size[0]),
        energy,
        float(without @ without),
    )


def log_evidence(scales: Sequence[Scale], factors: Sequence[float]) -> float:
    """Log density of the estimates if joint k's channel is ``factors[k]`` times its torque."""
    common, weights = _nodes(COMMON)
    own, own_weights = _nodes(OWN)
    total = np.log(weights)
    for scale, factor in zip(scales, factors):
        meant = factor * np.exp(common[:, None] + own[None, :])
        density = (1.0 - LOADED) * (_normal(scale.value - meant, scale.error) @ own_weights)
        density = density + LOADED * _normal(np.array(scale.value), float(np.hypot(scale.error, LOAD)))
        total = total + np.log(np.maximum(density, 1e-300))
    return float(np.logaddexp.reduce(total))


def log_absence(scales: Sequence[Scale], width: float = 0.0) -> float:
    """Log density if the column is absent from the torques, or present with a factor of order `width`."""
    densities = (_normal(np.array([s.value]), float(np.hypot(s.error, width)))[0] for s in scales)
    return float(sum(np.log(max(density, 1e-300)) for density in densities))


def _normal(apart: Array, error: float) -> Array:
    return np.asarray(np.exp(-0.5 * (apart / error) ** 2) / (error * np.sqrt(2 * np.pi)))


@cache
def _nodes(width: float) -> tuple[Array, Array]:
    """Nodes and weights of a Student distribution of that width."""
    at = np.sinh(np.linspace(-np.arcsinh(REACH), np.arcsinh(REACH), NODES))
    density = (1.0 + at**2 / FREEDOM) ** (-0.5 * (FREEDOM + 1.0)) * np.gradient(at)
    return at * width, density / density.sum()


def _solved(columns: Array, right: Array) -> Array:
    return np.asarray(np.linalg.lstsq(columns, right, rcond=RANK)[0])
