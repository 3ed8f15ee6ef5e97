"""The constant inertia integrals of a flexible body in its floating frame, from any mass matrix.

With nodal velocities R_t v + R_r(x) w + V x', where the columns of R_t are unit translations and those of
R_r rotations of the displaced nodes about the frame's origin, the kinetic energy is a quadratic form in
(v, w, x') whose blocks are linear and quadratic in x: docs/theory.md 2. For a lumped mass matrix they are
the node sums given there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from reference_model.flexible.mesh import ALL_SIX, Mesh, rigid_motions

__all__ = ["ShapeIntegrals", "axial", "cleaned", "crossed", "scalar_mass", "shape_integrals"]

Matrix = NDArray[np.float64]

#: Entries of an integral below this fraction of its largest one are rounding; as exact zeros they vanish
#: from every later expression.
ROUNDING = 1e-13

#: Axial vector: a x b = sum over rows and columns of a b^T with these weights, shape (3, 3, 3).
LEVI_CIVITA = np.cross(np.eye(3)[:, None], np.eye(3)[None]).transpose(2, 0, 1)


@dataclass(frozen=True)
class ShapeIntegrals:
    """Integrals about the frame's origin in the link's axes, s modes; names as in docs/theory.md 2.

    Attributes:
        mass: m [kg].
        first_moment: sum m rho0, shape (3,) [kg m].
        inertia: J0, shape (3, 3) [kg m^2].
        S0, S1: coupling of translation and rotation with the modes, shape (3, s).
        E: shape (s, 3, 3), sum m rho0~ phi_j~.
        F: shape (s, s, 3, 3), sum m phi_j~ phi_l~.
        D: shape (s, 3, s), sum m phi_j~ Phi.
        P: shape (3, s), sum J Psi.
        h: shape (s, s, 3), h[l, j] = sum m phi_l x phi_j.
    """

    mass: float
    first_moment: Matrix
    inertia: Matrix
    S0: Matrix
    S1: Matrix
    E: Matrix
    F: Matrix
    D: Matrix
    P: Matrix
    h: Matrix


def shape_integrals(mesh: Mesh, shapes: Matrix) -> ShapeIntegrals:
    """All integrals of a mesh with these mode shapes, (d N, s).

    m, J0, S0 and S1 are exact for any mass matrix. E, F, D and h, the second-order ones, need products of
    displacements that a mass matrix alone does not give: they take the translational mass between two nodes
    to be the same in all three directions (its mean is used) and neglect the coupling of displacements with
    rotations, which vanishes with the size of the elements. Both are exact for lumped masses and for solid
    elements. P then follows from S1, so that energy and momentum stay exactly conserved.

    A node's rotary inertia J rotates with the node, like the points that make it up: point a of the node
    moves by psi x a, and the sum of m a a^T over them is tr(J)/2 - J. Lumped masses then have P = 0. If J
    were constant in the link's axes, as in docs/theory.md 2, the gyroscopic moment of a body at the tip would
    not bend the link.
    """
    rigid = mesh.mass @ rigid_motions(mesh.nodes, mesh.freedoms)
    body = rigid_motions(mesh.nodes, mesh.freedoms).T @ rigid
    coupling = rigid.T @ shapes
    phi = shapes.reshape(len(mesh.nodes), mesh.freedoms, -1)[:, :3]
    pushed = (scalar_mass(mesh) @ phi.reshape(len(phi), -1)).reshape(phi.shape)
    first = np.einsum("na,nbj->jab", mesh.nodes, pushed)  # sum m rho0 phi_j^T
    second = np.einsum("naj,nbl->jlab", phi, pushed)  # sum m phi_j phi_l^T
    if mesh.freedoms == ALL_SIX:
        psi = shapes.reshape(len(mesh.nodes), mesh.freedoms, -1)[:, 3:]
        turned = _turned(mesh, psi)
        first += np.einsum("nabj->jab", turned)
        second += np.einsum("nacj,ncbl->jlab", _crosses(psi), turned)
    h, gyration = axial(second), coupling[3:] - axial(first).T
    return ShapeIntegrals(
        mass=float(np.trace(body[:3, :3])) / 3,
        first_moment=cleaned(axial(body[:3, 3:]) / 2),
        inertia=cleaned((body[3:, 3:] + body[3:, 3:].T) / 2),
        S0=cleaned(coupling[:3]),
        S1=cleaned(coupling[3:]),
        E=cleaned(crossed(first)),
        F=cleaned(crossed(second)),
        D=cleaned(np.swapaxes(h, 1, 2)),
        P=cleaned(gyration, scale=float(np.sqrt(np.abs(body[3:, 3:]).max()))),
        h=cleaned(h),
    )


def _turned(mesh: Mesh, psi: Matrix) -> Matrix:
    """Sum over nodes m of (sum of a a^T between n and m) (psi_m~)^T, shape (N, 3, 3, s)."""
    blocks = [[mesh.mass[3 + a :: ALL_SIX, 3 + b :: ALL_SIX] for b in range(3)] for a in range(3)]
    half = (blocks[0][0] + blocks[1][1] + blocks[2][2]) / 2
    crosses = _crosses(psi)
    found = np.zeros_like(crosses)
    for a in range(3):
        for c in range(3):
            weights = half - blocks[a][c] if a == c else -blocks[a][c]
            columns = crosses[:, :, c].reshape(len(psi), -1)
            found[:, a] += np.asarray(weights @ columns).reshape(len(psi), 3, -1)
    return found


def _crosses(psi: Matrix) -> Matrix:
    """psi~ of every node and mode, shape (N, 3, 3, s)."""
    return -np.einsum("abc,ncj->nabj", LEVI_CIVITA, psi)


def scalar_mass(mesh: Mesh) -> sparse.csr_array:
    """Translational mass between nodes, the mean of the three directions [kg], shape (N, N)."""
    parts = [mesh.mass[axis :: mesh.freedoms, axis :: mesh.freedoms] for axis in range(3)]
    return sparse.csr_array((parts[0] + parts[1] + parts[2]) / 3)


def cleaned(array: Matrix, scale: float | None = None) -> Matrix:
    """The array with rounding errors, relative to `scale` or its largest entry, set to exact zeros."""
    largest = float(np.abs(array).max(initial=0.0)) if scale is None else scale
    return np.where(np.abs(array) <= ROUNDING * largest, 0.0, array)


def axial(moments: Matrix) -> Matrix:
    """Sum of a x b from the sum of a b^T, shapes (..., 3, 3) to (..., 3)."""
    return np.einsum("iab,...ab->...i", LEVI_CIVITA, moments)


def crossed(moments: Matrix) -> Matrix:
    """Sum of a~ b~ = b a^T - (a.b) 1 from the sum of a b^T, shape (..., 3, 3)."""
    trace = np.einsum("...aa->...", moments)
    return np.swapaxes(moments, -1, -2) - trace[..., None, None] * np.eye(3)
