"""A beam's shape between its nodes: strain at gauges, and the foreshortening due to bending."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reference_model.flexible.beam import MIRROR, bending_weights, turned
from reference_model.flexible.mesh import ALL_SIX
from robot_model import Beam, StrainGauge

__all__ = ["foreshortening", "gauge_strain"]

Matrix = NDArray[np.float64]


def gauge_strain(beam: Beam, shapes: Matrix) -> Matrix:
    """Strain at each gauge per modal coordinate, shape (gauges, s) [1/(m sqrt(kg))].

    Strain u' - distance normal . (v'', w'') by the elements' own shape functions, u linear, v and w cubic.

    Args:
        beam: with its gauges.
        shapes: mode shapes in the link's axes, (6 N, s).
    """
    own = turned(shapes, beam.axes.T).reshape(beam.elements + 1, ALL_SIX, -1)
    rows = [_strain(beam, gauge, own) for gauge in beam.gauges]
    return np.array(rows).reshape(len(rows), shapes.shape[1])


def _strain(beam: Beam, gauge: StrainGauge, own: Matrix) -> Matrix:
    step = beam.length / beam.elements
    element = min(int(gauge.place / step), beam.elements - 1)
    curved = _curvature(gauge.place / step - element, step)
    ends = own[element : element + 2]
    stretch = (ends[1, 0] - ends[0, 0]) / step
    across = np.array(gauge.normal) / np.linalg.norm(gauge.normal)
    bent_y = curved @ ends[:, (1, 5)].reshape(4, -1)
    bent_z = (curved * MIRROR) @ ends[:, (2, 4)].reshape(4, -1)
    strain: Matrix = stretch - gauge.distance * (across[0] * bent_y + across[1] * bent_z)
    return strain


def _curvature(part: float, h: float) -> Matrix:
    """Second derivatives of the cubic Hermite functions of v1, v1', v2, v2' at `part` of an element."""
    return np.array([(12 * part - 6) / h**2, (6 * part - 4) / h, (6 - 12 * part) / h**2, (6 * part - 2) / h])


def foreshortening(beam: Beam, shapes: Matrix) -> Matrix:
    """B_k of every node: bending moves node k by -1/2 x^T B_k x along the beam's axis, shape (N, s, s).

    B_k is the integral of v'^T v' + w'^T w' from the root to node k, exact for the cubic shape functions.
    """
    own = turned(shapes, beam.axes.T).reshape(beam.elements + 1, ALL_SIX, -1)
    weights = bending_weights(beam.length / beam.elements)
    planes = ((own[:, (1, 5)], weights), (own[:, (2, 4)], weights * np.outer(MIRROR, MIRROR)))
    total = np.zeros((len(own), shapes.shape[1], shapes.shape[1]))
    for plane, weight in planes:
        ends = np.concatenate([plane[:-1], plane[1:]], axis=1)  # (elements, 4, s)
        total[1:] += np.cumsum(np.einsum("eas,ab,ebt->est", ends, weight, ends), axis=0)
    return total
