"""Finite elements as exported by other programs: a frame of beams, a lattice of bars.

They use no code of either engine. Masses are consistent: they couple nodes with their neighbours, and those
of the frame couple displacements with rotations.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import combinations, product
from math import sqrt
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

__all__ = ["MESHES", "mesh_file"]

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array]

#: Aluminium: Young's and shear modulus [Pa], density [kg/m^3].
YOUNG, SHEAR, DENSITY = 70e9, 27e9, 2700.0
#: Section of the frame: area [m^2], polar, and both second moments [m^4].
FRAME = (1.2e-4, 2e-8, 0.9e-8, 1.1e-8)
#: Area of the lattice's bars [m^2], length of its cells [m], and its plastic: Young's modulus, density.
BAR, CELL = 4e-5, 0.25
PLASTIC, PLASTIC_DENSITY = 2e9, 1100.0


def frame() -> Matrices:
    """A mast of five beams with a skew branch of three: nodes, mass and stiffness, six rows a node."""
    stem = [(0.2 * k, 0.0, 0.0) for k in range(6)]
    branch = [(0.6 + 0.1 * k, 0.12 * k, 0.08 * k) for k in (1, 2, 3)]
    nodes = np.array([*stem, *branch])
    elements = [*((k, k + 1) for k in range(5)), (3, 6), (6, 7), (7, 8)]
    return nodes, *_assembled(nodes, elements, 6, _beam)


def lattice() -> Matrices:
    """A box of bars with diagonals, four cells long and one wide: three rows a node."""
    nodes = CELL * np.array(list(product(range(5), range(2), range(2))), dtype=float)
    nodes[:, 1] *= 0.8
    near = sqrt(3.0) * CELL + 1e-9
    bars = [p for p in combinations(range(len(nodes)), 2) if np.linalg.norm(nodes[p[0]] - nodes[p[1]]) < near]
    return nodes, *_assembled(nodes, bars, 3, _bar)


MESHES: Mapping[str, Callable[[], Matrices]] = MappingProxyType({"frame": frame, "lattice": lattice})


@cache
def _folder() -> Path:
    path = mkdtemp(prefix="meshes-")
    atexit.register(rmtree, path, ignore_errors=True)
    return Path(path)


@cache
def mesh_file(name: str) -> str:
    """The NPZ file of a mesh; it exists while this process runs."""
    nodes, mass, stiffness = MESHES[name]()
    path = _folder() / f"{name}.npz"
    np.savez(path, nodes=nodes, mass=mass, stiffness=stiffness)
    return str(path)


def _assembled(
    nodes: Array,
    elements: Sequence[tuple[int, int]],
    freedoms: int,
    element: Callable[[Array], tuple[Array, Array]],
) -> tuple[Array, Array]:
    count = freedoms * len(nodes)
    mass, stiffness = np.zeros((count, count)), np.zeros((count, count))
    for first, second in elements:
        rows = [
            *range(freedoms * first, freedoms * (first + 1)),
            *range(freedoms * second, freedoms * (second + 1)),
        ]
        own = element(nodes[second] - nodes[first])
        mass[np.ix_(rows, rows)] += own[0]
        stiffness[np.ix_(rows, rows)] += own[1]
    return mass, stiffness


def _bar(span: Array) -> tuple[Array, Array]:
    """Consistent mass and stiffness of a bar, shape (6, 6)."""
    length = float(np.linalg.norm(span))
    along = np.outer(span, span) / length**2
    mass = PLASTIC_DENSITY * BAR * length / 6 * np.kron([[2.0, 1.0], [1.0, 2.0]], np.eye(3))
    return mass, PLASTIC * BAR / length * np.kron([[1.0, -1.0], [-1.0, 1.0]], along)


def _beam(span: Array) -> tuple[Array, Array]:
    """Consistent mass and stiffness of an Euler-Bernoulli beam in space, shape (12, 12).

    Przemieniecki, Theory of Matrix Structural Analysis (1968), eqs. 5.116 and 11.24; slender: without the
    rotary inertia of bending.
    """
    area, polar, second_y, second_z = FRAME
    length = float(np.linalg.norm(span))
    mass, stiffness = np.zeros((12, 12)), np.zeros((12, 12))
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    for rows, inertia, stiff in (
        ((0, 6), area, YOUNG * area),
        ((3, 9), polar, SHEAR * polar),
    ):
        mass[np.ix_(rows, rows)] = DENSITY * inertia * length / 6 * np.array([[2.0, 1.0], [1.0, 2.0]])
        stiffness[np.ix_(rows, rows)] = stiff / length * pair
    for bent, second, mirror in (((1, 5, 7, 11), second_z, 1.0), ((2, 4, 8, 10), second_y, -1.0)):
        slopes = np.array([1.0, mirror * length, 1.0, mirror * length])
        scale = np.outer(slopes, slopes)
        mass[np.ix_(bent, bent)] = DENSITY * area * length / 420 * _CUBIC_MASS * scale
        stiffness[np.ix_(bent, bent)] = YOUNG * second / length**3 * _CUBIC_STIFFNESS * scale
    x = span / length
    y = np.cross([0.3, -0.5, 0.8], x)
    y /= np.linalg.norm(y)
    turn = np.kron(np.eye(4), np.column_stack([x, y, np.cross(x, y)]))
    return turn @ mass @ turn.T, turn @ stiffness @ turn.T


_CUBIC_MASS = np.array(
    [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]], dtype=float
)
_CUBIC_STIFFNESS = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], dtype=float)
