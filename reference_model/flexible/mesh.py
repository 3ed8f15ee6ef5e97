"""A flexible body before its modes are computed: nodes with mass and stiffness matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

__all__ = ["ALL_SIX", "Mesh", "cross_matrices", "rigid_motions"]

Matrix = NDArray[np.float64]

#: Degrees of freedom of a node with rotations: displacements x, y, z, then rotations about x, y, z.
ALL_SIX = 6


@dataclass(frozen=True)
class Mesh:
    """A free, undeformed finite-element body in its link's axes.

    Attributes:
        nodes: positions [m], shape (N, 3).
        mass: mass matrix, shape (d N, d N), d degrees of freedom for each node [kg, kg m, kg m^2].
        stiffness: stiffness matrix of the same shape [N/m, N, N m].
        freedoms: d, 6 with rotations or 3 without.
    """

    nodes: Matrix
    mass: sparse.csr_array
    stiffness: sparse.csr_array
    freedoms: int = ALL_SIX


def cross_matrices(vectors: Matrix) -> Matrix:
    """The matrices a~ with a~ b = a x b for each vector, shape (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=float), -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rigid_motions(nodes: Matrix, freedoms: int = ALL_SIX) -> Matrix:
    """Nodal displacements of unit translations and unit small rotations about the origin, shape (d N, 6)."""
    count = len(nodes)
    motions = np.zeros((count, freedoms, 6))
    motions[:, :3, :3] = np.eye(3)
    motions[:, :3, 3:] = -cross_matrices(nodes)
    if freedoms == ALL_SIX:
        motions[:, 3:, 3:] = np.eye(3)
    return motions.reshape(freedoms * count, 6)
