"""Finite elements of a straight beam: lumped masses, Euler-Bernoulli stiffness, modes.

Node by node three displacements and three rotations, all in the link's axes. Half of every element's mass
goes to each of its nodes, with the rotary inertia diag(rho J h/2, rho I_y h/2 + m h^2/24,
rho I_z h/2 + m h^2/24) of that half in the section's axes; the tip body is added to the last node.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import inf, pi

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, eigh

from robot_model import Beam, InputError
from robot_model.description.flexible import Modes

__all__ = [
    "Node",
    "Shapes",
    "beam_nodes",
    "beam_shapes",
    "damping_of",
    "kept_modes",
    "settled",
    "signed",
]

Array = NDArray[np.float64]

#: Squared frequencies, and amplitudes, closer than this count as equal up to rounding.
SAME_SQUARE = 1e-6
#: Degrees of freedom of a node.
SIX = 6


@dataclass(frozen=True)
class Node:
    """A lumped mass.

    Attributes:
        position: in the link's frame [m], shape (3,).
        mass: [kg].
        inertia: about the node in the link's axes [kg m^2], shape (3, 3).
    """

    position: Array
    mass: float
    inertia: Array


@dataclass(frozen=True)
class Shapes:
    """Mode shapes, mass-normalised.

    Attributes:
        frequencies: rising [rad/s], shape (s,).
        translations, rotations: of every node, shape (N, 3, s).
        strain: of every gauge per modal coordinate, shape (gauges, s).
    """

    frequencies: Array
    translations: Array
    rotations: Array
    strain: Array


def beam_nodes(beam: Beam) -> tuple[Node, ...]:
    """The nodes of a beam with its tip body, without hub."""
    area, _, second_y, second_z = beam.section.figures
    h = beam.length / beam.elements
    half = 0.5 * beam.density * area * h
    # Each half of an element, m/2, is a rod of length h/2 at its node; see docs/theory.md (4).
    swing = 2 * half * h**2 / 24
    moments = 0.5 * beam.density * h * np.array([second_y + second_z, second_y, second_z])
    moments += [0.0, swing, swing]
    found = []
    for k, position in enumerate(beam.nodes):
        halves = 1 if k in (0, beam.elements) else 2
        mass, inertia = halves * half, halves * moments
        if k == beam.elements:
            mass, inertia = mass + beam.tip.mass, inertia + np.asarray(beam.tip.inertia)
        found.append(Node(position, mass, beam.axes @ np.diag(inertia) @ beam.axes.T))
    return tuple(found)


@cache
def beam_shapes(beam: Beam) -> Shapes:
    """The lowest modes of a beam, clamped at its root or free, with its tip body.

    Solves K V = M V diag(w^2) with V^T M V = 1; of a free beam, its six rigid motions are left out. Equal
    frequencies leave the shapes undetermined: those that bend along the section's y axis then come before
    those along z. Signs make the largest displacement of a mode positive, of several the last one.
    """
    nodes = beam_nodes(beam)
    mass = block_diag(*(block for node in nodes for block in (node.mass * np.eye(3), node.inertia)))
    stiffness = _stiffness(beam)
    held = SIX if beam.boundary == "clamped" else 0
    rigid = SIX - held
    squares, vectors = _rising(stiffness[held:, held:], mass[held:, held:], definite=not rigid)
    frequencies = np.sqrt(np.maximum(squares[rigid:], 0.0))
    count = kept_modes(beam, frequencies)
    columns = np.zeros((len(mass), len(frequencies)))
    columns[held:] = vectors[:, rigid:]

    def turn(group: Array) -> Array:
        across = np.einsum("a,nas->ns", beam.axes[:, 1], group.reshape(len(nodes), 2, 3, -1)[:, 0])
        return np.linalg.eigh(across.T @ across)[1][:, ::-1]

    shapes = settled(columns, squares[rigid:], turn).reshape(len(nodes), 2, 3, -1)
    shapes = (shapes * signed(shapes[:, 0], shapes[:, 1], beam.length))[..., :count]
    translations, rotations = shapes[:, 0], shapes[:, 1]
    return Shapes(frequencies[:count], translations, rotations, _strain(beam, translations, rotations))


def _rising(stiffness: Array, mass: Array, *, definite: bool) -> tuple[Array, Array]:
    """Squared frequencies, rising, and shapes normalised by mass.

    A definite stiffness is inverted, M V = K V / w^2: errors are then rounding beside the lowest squares, and
    not beside the highest ones of the mesh, which with a heavy tip body are a million times as large.
    """
    if not definite:
        squares, vectors = eigh(stiffness, mass)
        return squares, vectors
    inverse, vectors = eigh(mass, stiffness)
    return 1 / inverse[::-1], (vectors / np.sqrt(inverse))[:, ::-1]


def settled(columns: Array, squares: Array, turn: Callable[[Array], Array]) -> Array:
    """Modes as columns, those of equal frequency rotated within their subspace by the matrix from `turn`."""
    found = columns.copy()
    edges = [0, *(np.flatnonzero(np.diff(squares) > SAME_SQUARE * squares[1:]) + 1), len(squares)]
    for start, stop in pairwise(int(edge) for edge in edges):
        found[:, start:stop] = found[:, start:stop] @ turn(found[:, start:stop])
    return found


def signed(translations: Array, rotations: Array, length: float) -> Array:
    """Signs that make the largest displacement of every mode positive, of several the last one, shape (s,).

    A mode that only turns goes by its rotations, times `length` [m]. Shapes (N, 3, s), or (N, 0, s) without
    rotations.
    """
    signs = np.ones(translations.shape[-1])
    for k in range(len(signs)):
        moves, turns = translations[..., k].ravel(), length * rotations[..., k].ravel()
        turning = np.abs(moves).max() < SAME_SQUARE * np.abs(turns).max(initial=0.0)
        values = turns if turning else moves
        largest = values[np.flatnonzero(np.abs(values) >= (1 - SAME_SQUARE) * np.abs(values).max())[-1]]
        signs[k] = 1.0 if largest > 0 else -1.0
    return signs


def kept_modes(body: Modes, frequencies: Array) -> int:
    """Number of modes that are kept."""
    if body.modes is not None:
        return body.modes
    count = int(np.sum(frequencies <= 2 * pi * (body.highest_frequency or inf)))
    if count == 0:
        raise InputError(
            f"no mode lies below highest_frequency = {body.highest_frequency:g} Hz; the lowest has "
            f"{frequencies[0] / (2 * pi):.6g} Hz."
        )
    return count


def damping_of(body: Modes, frequencies: Array) -> Array:
    """Damping matrix of mass-normalised modes [1/s], shape (s, s)."""
    if body.rayleigh is not None:
        return np.diag(body.rayleigh[0] + body.rayleigh[1] * frequencies**2)
    ratios = body.damping_ratio
    if isinstance(ratios, tuple) and len(ratios) != len(frequencies):
        raise InputError(
            f"damping_ratio has {len(ratios)} entries, but {len(frequencies)} modes are kept; "
            "a single number is for all."
        )
    return np.diag(2 * np.asarray(ratios) * frequencies * np.ones(len(frequencies)))


def _stiffness(beam: Beam) -> Array:
    """Of the free beam, shape (6 N, 6 N)."""
    h, count = beam.length / beam.elements, SIX * (beam.elements + 1)
    whole = np.zeros((count, count))
    element = _element(beam, h)
    for k in range(beam.elements):
        rows = slice(SIX * k, SIX * (k + 2))
        whole[rows, rows] += element
    turn = np.kron(np.eye(2 * (beam.elements + 1)), beam.axes)
    return turn @ whole @ turn.T


def _element(beam: Beam, h: float) -> Array:
    """Of one element in the section's axes (Przemieniecki 1968, eq. 5.116, without shear), shape (12, 12)."""
    area, torsion, second_y, second_z = beam.section.figures
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    bending = np.array(
        [
            [12, 6 * h, -12, 6 * h],
            [6 * h, 4 * h * h, -6 * h, 2 * h * h],
            [-12, -6 * h, 12, -6 * h],
            [6 * h, 2 * h * h, -6 * h, 4 * h * h],
        ]
    )
    mirror = np.diag([1.0, -1.0, 1.0, -1.0])  # theta_y = -dw/dx
    whole = np.zeros((2 * SIX, 2 * SIX))
    whole[np.ix_([0, 6], [0, 6])] = beam.young * area / h * pair
    whole[np.ix_([3, 9], [3, 9])] = beam.shear * torsion / h * pair
    whole[np.ix_([1, 5, 7, 11], [1, 5, 7, 11])] = beam.young * second_z / h**3 * bending
    whole[np.ix_([2, 4, 8, 10], [2, 4, 8, 10])] = beam.young * second_y / h**3 * mirror @ bending @ mirror
    return whole


def _strain(beam: Beam, translations: Array, rotations: Array) -> Array:
    """u' - normal . (v'', w'') distance from the cubics of the gauge's element, shape (gauges, s)."""
    h = beam.length / beam.elements
    rows = []
    for gauge in beam.gauges:
        k = min(int(gauge.place / h), beam.elements - 1)
        t = gauge.place / h - k
        normal = np.asarray(gauge.normal) / np.linalg.norm(gauge.normal)
        moved = np.einsum("ab,nas->nbs", beam.axes, translations[k : k + 2])
        turned = np.einsum("ab,nas->nbs", beam.axes, rotations[k : k + 2])
        weights = np.array([6 - 12 * t, 12 * t - 6]) / -(h * h), np.array([6 * t - 4, 6 * t - 2]) / h
        curve_v = weights[0] @ moved[:, 1] + weights[1] @ turned[:, 2]
        curve_w = weights[0] @ moved[:, 2] - weights[1] @ turned[:, 1]
        stretch = (moved[1, 0] - moved[0, 0]) / h
        rows.append(stretch - gauge.distance * (normal[0] * curve_v + normal[1] * curve_w))
    return np.array(rows).reshape(len(beam.gauges), translations.shape[2])
