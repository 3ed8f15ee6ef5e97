"""A flexible body with a rigid body added at one of its nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reference_model.flexible.body import FlexibleBody
from reference_model.flexible.integrals import axial, crossed
from reference_model.flexible.mesh import cross_matrices

__all__ = ["attached"]

Matrix = NDArray[np.float64]


def attached(body: FlexibleBody, node: int, mass: float, arm: Matrix, inertia: Matrix) -> FlexibleBody:
    """The body with a rigid body fixed to a node: its integrals with one more term in their sums.

    The mode shapes are unchanged: they are no longer the modes of the loaded body, and their mass matrix is
    not a unit matrix. The more modes are kept, the less this matters.

    Args:
        body: constants.
        node: index of the node.
        mass: added mass [kg]; a negative one is removed.
        arm: from the node to its centre of mass, in the link's axes, shape (3,) [m].
        inertia: about its centre of mass, in the link's axes, shape (3, 3) [kg m^2].
    """
    psi = body.rotations[node]
    phi = body.translations[node] - cross_matrices(arm) @ psi
    place = body.nodes[node] + arm
    across, own = cross_matrices(place), cross_matrices(phi.T)
    turns = cross_matrices(psi.T)
    # Sum of a a^T over the points that make up the inertia, which rotate with the node (see `integrals`).
    around = np.trace(inertia) / 2 * np.eye(3) - inertia
    first = around @ np.swapaxes(turns, 1, 2)
    second = turns[:, None] @ first[None]
    products = mass * np.cross(phi.T[:, None], phi.T[None]) + axial(second)  # [j, l] is sum m phi_j x phi_l
    masses, inertias = body.node_masses.copy(), body.node_inertias.copy()
    masses[node] += mass
    inertias[node] += inertia - mass * cross_matrices(arm) @ cross_matrices(arm)
    return replace(
        body,
        mass=body.mass + mass,
        first_moment=body.first_moment + mass * place,
        inertia=body.inertia + inertia - mass * across @ across,
        S0=body.S0 + mass * phi,
        S1=body.S1 + mass * across @ phi + inertia @ psi,
        E=body.E + mass * across @ own + crossed(first),
        F=body.F + mass * own[:, None] @ own[None] + crossed(second),
        D=body.D + products.transpose(0, 2, 1),
        h=body.h + products,
        modal_mass=body.modal_mass + mass * phi.T @ phi + psi.T @ inertia @ psi,
        node_masses=masses,
        node_inertias=inertias,
    )
