"""Straight Euler-Bernoulli beams by lumped-mass finite elements.

In the beam's own axes (x along it, y and z the section's principal axes) stretching, torsion and the two
bending planes do not couple. Each is solved separately, so that the modes of a symmetric section lie in its
planes, independent of rounding in equal frequencies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from reference_model.flexible.mesh import ALL_SIX, Mesh
from reference_model.flexible.modes import Keep, Modes, lowest_modes, sorted_modes
from robot_model import Beam

__all__ = ["FAMILIES", "beam_mesh", "beam_modes", "bending_weights", "turned"]

Matrix = NDArray[np.float64]

#: Degrees of freedom of a node that move together: (v, theta_z), (w, theta_y), torsion, stretching.
FAMILIES = ((1, 5), (2, 4), (3,), (0,))

#: theta_z = v' but theta_y = -w': signs that turn the matrices of one bending plane into the other's.
MIRROR = np.array([1.0, -1.0, 1.0, -1.0])


def beam_mesh(beam: Beam) -> Mesh:
    """The free beam with its tip body, in the link's axes."""
    mass, stiffness = _in_own_axes(beam)
    turn = sparse.kron(sparse.eye_array(2 * (beam.elements + 1)), beam.axes)
    return Mesh(
        nodes=beam.nodes,
        mass=sparse.csr_array(turn @ sparse.diags_array(mass) @ turn.T),
        stiffness=sparse.csr_array(turn @ stiffness @ turn.T),
    )


def beam_modes(beam: Beam, keep: Keep) -> Modes:
    """Modes of the beam with its tip body in the link's axes, clamped at its root or free."""
    mass, stiffness = _in_own_axes(beam)
    clamped = beam.boundary == "clamped"
    found = []
    for family in FAMILIES:
        places = _places(family, beam.elements + 1)[len(family) if clamped else 0 :]
        rigid = None if clamped else _rigid(family, beam)
        part = lowest_modes(
            stiffness[places][:, places].toarray(), np.diag(mass[places]), keep=keep, rigid=rigid
        )
        shapes = np.zeros((len(mass), len(part.squares)))
        shapes[places] = part.shapes
        found.append(Modes(part.squares, shapes))
    modes = sorted_modes(found, keep)
    return Modes(modes.squares, turned(modes.shapes, beam.axes))


def turned(shapes: Matrix, axes: Matrix) -> Matrix:
    """Nodal displacements in the beam's axes, (6 N, s), in the link's axes."""
    parts = shapes.reshape(len(shapes) // 3, 3, shapes.shape[1])
    return np.einsum("ab,nbs->nas", axes, parts).reshape(shapes.shape)


def _in_own_axes(beam: Beam) -> tuple[Matrix, sparse.csr_array]:
    """Diagonal of the mass matrix, shape (6 N,), and stiffness matrix in the beam's axes."""
    return _lumped_mass(beam), _stiffness(beam)


def _lumped_mass(beam: Beam) -> Matrix:
    """Half of the mass and rotary inertia of each element at its ends, tip body last; docs/theory.md (4).

    Across the beam, half an element is a rod of mass m/2 and length h/2 turning about its end: m h^2/24.
    """
    area, _, second_y, second_z = beam.section.figures
    step = beam.length / beam.elements
    whole = beam.density * area * step
    around = beam.density * step / 2 * np.array([second_y + second_z, second_y, second_z])
    half = np.concatenate([np.full(3, whole / 2), around + whole * step**2 / 24 * np.array([0, 1, 1])])
    nodes = np.zeros((beam.elements + 1, ALL_SIX))
    nodes[:-1] += half
    nodes[1:] += half
    nodes[-1] += [*[beam.tip.mass] * 3, *beam.tip.inertia]
    return nodes.ravel()


def _stiffness(beam: Beam) -> sparse.csr_array:
    """Stretching, torsion and bending stiffness of all elements, shape (6 N, 6 N)."""
    area, torsion, second_y, second_z = beam.section.figures
    step = beam.length / beam.elements
    bar = np.array([[1.0, -1.0], [-1.0, 1.0]]) / step
    bending = _bending(step)
    blocks = {
        (0,): beam.young * area * bar,
        (3,): beam.shear * torsion * bar,
        (1, 5): beam.young * second_z * bending,
        (2, 4): beam.young * second_y * bending * np.outer(MIRROR, MIRROR),
    }
    rows, columns, entries = [], [], []
    for family, block in blocks.items():
        first = _places(family, 2)
        places = first + ALL_SIX * np.arange(beam.elements)[:, None]  # (elements, rows of the block)
        rows.append(np.repeat(places, len(first), axis=1).ravel())
        columns.append(np.tile(places, len(first)).ravel())
        entries.append(np.tile(block.ravel(), beam.elements))
    where = (np.concatenate(rows), np.concatenate(columns))
    count = ALL_SIX * (beam.elements + 1)
    return sparse.csr_array(sparse.coo_array((np.concatenate(entries), where), shape=(count, count)))


def _bending(h: float) -> Matrix:
    """Integral of N''^T N'' over an element of length h, N the cubic Hermite functions [1/m^3 ...]."""
    return (
        np.array(
            [
                [12, 6 * h, -12, 6 * h],
                [6 * h, 4 * h**2, -6 * h, 2 * h**2],
                [-12, -6 * h, 12, -6 * h],
                [6 * h, 2 * h**2, -6 * h, 4 * h**2],
            ]
        )
        / h**3
    )


def bending_weights(h: float) -> Matrix:
    """Integral of N'^T N' over an element: its geometric stiffness under unit tension [1/m ...]."""
    return np.array(
        [
            [36, 3 * h, -36, 3 * h],
            [3 * h, 4 * h**2, -3 * h, -(h**2)],
            [-36, -3 * h, 36, -3 * h],
            [3 * h, -(h**2), -3 * h, 4 * h**2],
        ]
    ) / (30 * h)


def _places(family: tuple[int, ...], nodes: int) -> NDArray[np.intp]:
    """Rows of a family in the order node by node."""
    return (ALL_SIX * np.arange(nodes)[:, None] + np.array(family)).ravel()


def _rigid(family: tuple[int, ...], beam: Beam) -> Matrix:
    """Rigid motions of a family: a translation or a rotation, and in a bending plane both."""
    count = beam.elements + 1
    if len(family) == 1:
        return np.ones((count, 1))
    slope = 1.0 if family == (1, 5) else -1.0
    along = np.linspace(0.0, beam.length, count)
    shift = np.column_stack([np.ones(count), np.zeros(count)]).ravel()
    turn = np.column_stack([along, np.full(count, slope)]).ravel()
    return np.column_stack([shift, turn])
