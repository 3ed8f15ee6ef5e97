"""A block of trilinear solid elements: external finite elements for the tests of imported bodies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from scipy import sparse

__all__ = ["Block", "save"]

#: Corners of the unit element, in the order of its nodes.
CORNERS = np.array(list(product((0, 1), repeat=3)))


@dataclass(frozen=True)
class Block:
    """A box of `size` [m] from the origin along x, centred in y and z, in `cells` elements."""

    size: tuple[float, float, float] = (1.0, 0.2, 0.1)
    cells: tuple[int, int, int] = (6, 2, 2)
    young: float = 1e9
    poisson: float = 0.3
    density: float = 1000.0

    @property
    def nodes(self) -> np.ndarray:
        ends = [np.linspace(0, side, count + 1) for side, count in zip(self.size, self.cells)]
        nodes = np.array(list(product(*ends)))
        return nodes - np.array([0, self.size[1] / 2, self.size[2] / 2])

    @property
    def elements(self) -> np.ndarray:
        """Nodes of each element."""
        shape = np.array(self.cells) + 1
        cells = np.array(list(product(*(range(count) for count in self.cells))))
        return np.ravel_multi_index(tuple(np.moveaxis(cells[:, None] + CORNERS, -1, 0)), tuple(shape))

    def points(self, order: int) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
        """Weight [m^3], shape functions (8,) and their gradients (8, 3) at Gauss points of an element."""
        sides = np.array(self.size) / np.array(self.cells)
        places, weights = np.polynomial.legendre.leggauss(order)
        for index in product(range(order), repeat=3):
            place = (places[list(index)] + 1) / 2
            ends = np.where(CORNERS, place, 1 - place)
            slopes = np.where(CORNERS, 1.0, -1.0) / sides
            gradients = np.column_stack(
                [slopes[:, axis] * np.delete(ends, axis, axis=1).prod(axis=1) for axis in range(3)]
            )
            yield float(np.prod(weights[list(index)] / 2) * sides.prod()), ends.prod(axis=1), gradients

    @property
    def matrices(self) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Consistent mass matrix and stiffness matrix, three rows for each node."""
        mass, stiffness = np.zeros((24, 24)), np.zeros((24, 24))
        for weight, shape, gradient in self.points(2):
            mass += weight * self.density * np.kron(np.outer(shape, shape), np.eye(3))
            strain = _strain(gradient)
            stiffness += weight * strain.T @ self.elasticity @ strain
        rows = (3 * self.elements[:, :, None] + np.arange(3)).reshape(-1, 24)
        where = (np.repeat(rows, 24, axis=1).ravel(), np.tile(rows, 24).ravel())
        count = 3 * len(self.nodes)
        return tuple(
            sparse.csr_array(sparse.coo_array((np.tile(m.ravel(), len(rows)), where), shape=(count, count)))
            for m in (mass, stiffness)
        )

    @property
    def elasticity(self) -> np.ndarray:
        shear = self.young / (2 * (1 + self.poisson))
        lame = self.young * self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson))
        return np.diag([2.0 * shear] * 3 + [shear] * 3) + lame * np.outer(
            [1] * 3 + [0] * 3, [1] * 3 + [0] * 3
        )


def _strain(gradient: np.ndarray) -> np.ndarray:
    """Strains xx yy zz xy yz zx of the element's displacements, shape (6, 24)."""
    strain = np.zeros((6, 8, 3))
    for axis in range(3):
        strain[axis, :, axis] = gradient[:, axis]
        other = (axis + 1) % 3
        strain[3 + axis, :, axis] = gradient[:, other]
        strain[3 + axis, :, other] = gradient[:, axis]
    return strain.reshape(6, 24)


def save(path: Path, nodes: np.ndarray, mass: sparse.csr_array, stiffness: sparse.csr_array) -> Path:
    """An NPZ file with sparse matrices."""
    parts = {
        f"{name}_{part}": getattr(matrix, part)
        for name, matrix in (("mass", mass), ("stiffness", stiffness))
        for part in ("data", "indices", "indptr")
    }
    np.savez(path, nodes=nodes, **parts)
    return path
