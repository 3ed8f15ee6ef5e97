"""Modes and masses of a body from other finite element software.

Its matrices may couple displacements with rotations. Exudyn's modal body has points with displacements only:
the displacements' mass, the mean of the three directions, goes to the nodes, and rotary inertia to points
around them that rotate with them. All other terms of the matrices for the rigid body and its couplings with
small deflections are kept as a `Surplus`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import ArpackError, eigsh
from scipy.spatial import KDTree

from exudyn_model.bodies.beam import Shapes, kept_modes, settled, signed
from exudyn_model.bodies.moments import Points, Surplus, axial, moments_of
from exudyn_model.bodies.rotation import skew
from robot_model import InputError, ModalBody, read_modal_file

__all__ = ["Imported", "imported"]

Array = NDArray[np.float64]

#: Degrees of freedom of a node with rotations.
SIX = 6
#: Relative tolerance for values that should be zero, in files of single precision.
SINGLE = 1e-6
#: Relative rounding error of the integrals.
ROUNDING = 1e-12
#: Up to this many rows all modes are computed directly; beyond, the lowest by iteration.
DENSE = 1500
#: Modes computed beyond those kept, so that a group of equal frequencies is complete.
SPARE = 6
#: Lowest over highest squared frequency below which a part of the body is loose.
LOOSE = 1e-14
#: Neighbours that determine the rotation of a node without rotations.
NEIGHBOURS = 12


@dataclass(frozen=True, eq=False)
class Imported:
    """A body as defined by a file.

    Attributes:
        nodes: places in the link's frame [m], shape (N, 3).
        shapes: modes, in increasing order.
        points: its masses.
        surplus: inertia in addition to that of the points; None where there is none.
        mass: [kg].
        first_moment: [kg m], shape (3,).
        inertia: about the frame's origin [kg m^2], shape (3, 3).
        tip: node of the tip channels.
    """

    nodes: Array
    shapes: Shapes
    points: Points
    surplus: Surplus | None
    mass: float
    first_moment: Array
    inertia: Array
    tip: int


@dataclass(frozen=True, eq=False)
class _Mesh:
    nodes: Array
    mass: sparse.csr_array
    stiffness: sparse.csr_array
    freedoms: int
    where: str

    @property
    def size(self) -> float:
        return float(np.linalg.norm(np.ptp(self.nodes, axis=0)))

    def rigid(self) -> Array:
        """Unit translations and unit turns about the origin, shape (d N, 6)."""
        found = np.zeros((len(self.nodes), self.freedoms, SIX))
        for node, rows in zip(self.nodes, found):
            rows[:3, :3], rows[:3, 3:] = np.eye(3), -skew(node)
            rows[3:, 3:] = np.eye(SIX)[3 : self.freedoms, 3:]
        return found.reshape(-1, SIX)

    def refuse(self, why: str) -> InputError:
        return InputError(f"{self.where}: {why}")


def imported(name: str, body: ModalBody) -> Imported:
    """The modes and masses of a modal body of a link of this name.

    Raises:
        InputError: the file cannot be used, or the body has no such modes.
    """
    mesh = _read(name, body)
    squares, columns = _modes(mesh, body)
    tip = len(mesh.nodes) - 1 if body.tip is None else body.tip
    columns = _oriented(mesh, squares, columns, tip)
    count = _kept(mesh, body, squares)
    squares, columns = squares[:count], columns[:, :count]
    parts = columns.reshape(len(mesh.nodes), mesh.freedoms, -1)
    turns = parts[:, 3:] if mesh.freedoms == SIX else _turns(mesh, body, parts)
    points = _points(mesh, parts)
    rigid = mesh.rigid()
    whole = rigid.T @ (mesh.mass @ rigid)
    coupling = rigid.T @ (mesh.mass @ columns)
    mass = float(np.trace(whole[:3, :3])) / 3
    return Imported(
        mesh.nodes,
        Shapes(np.sqrt(squares), parts[:, :3].copy(), turns.copy(), np.zeros((0, count))),
        points,
        _surplus(points, whole, coupling),
        mass,
        _first(whole),
        0.5 * (whole[3:, 3:] + whole[3:, 3:].T),
        tip,
    )


def _read(name: str, body: ModalBody) -> _Mesh:
    where = f"link '{name}', modal.file {body.file}"
    try:
        found = read_modal_file(body.file)
    except InputError as error:
        raise InputError(f"link '{name}': {error}") from None
    freedoms = found.mass.shape[0] // len(found.nodes)
    mesh = _Mesh(found.nodes, found.mass, found.stiffness, freedoms, where)
    for key, node in (*(("root", root) for root in body.roots), ("tip", body.tip)):
        if node is not None and node >= len(mesh.nodes):
            raise mesh.refuse(f"{key} = {node}, but the file has nodes 0 to {len(mesh.nodes) - 1}.")
    rigid = mesh.rigid()
    whole = rigid[:, :3].T @ (mesh.mass @ rigid[:, :3])
    if np.abs(whole - np.trace(whole) / 3 * np.eye(3)).max() > SINGLE * np.trace(whole) / 3:
        raise mesh.refuse("its mass is not the same along x, y and z; give the matrix of the free body.")
    held = np.abs(mesh.stiffness @ rigid)
    if (held > SINGLE * (abs(mesh.stiffness) @ np.abs(rigid)).max(axis=0)).any():
        raise mesh.refuse("its stiffness resists a rigid motion; give the matrix of the free body.")
    if body.boundary == "free" and np.linalg.norm(mesh.nodes[body.roots[0]]) > SINGLE * mesh.size:
        raise mesh.refuse("a body with free modes has its root at its frame's origin; move the nodes.")
    return mesh


def _modes(mesh: _Mesh, body: ModalBody) -> tuple[Array, Array]:
    """Squared frequencies, rising, and mass-normalised modes as columns, some more than are kept."""
    rows, rigid = mesh.mass.shape[0], mesh.rigid()
    moving = np.ones(rows, dtype=bool)
    if body.boundary == "clamped":
        for root in body.roots:
            moving[root * mesh.freedoms : (root + 1) * mesh.freedoms] = False
        scaled = rigid[~moving] / np.array([1.0, 1.0, 1.0, mesh.size, mesh.size, mesh.size])
        if np.linalg.matrix_rank(scaled, tol=SINGLE) < SIX:
            raise mesh.refuse(
                f"holding root = {list(body.roots)} leaves the body free to turn; name three nodes or more "
                "that are not in line, or use free modes."
            )
    places = np.flatnonzero(moving)
    mass, stiffness = (matrix[places][:, places] for matrix in (mesh.mass, mesh.stiffness))
    free = rigid if body.boundary == "free" else None
    try:
        if len(places) <= DENSE:
            squares, shapes = _all_modes(mass.toarray(), stiffness.toarray(), free)
        else:
            squares, shapes = _lowest_modes(mass, stiffness, free, body)
    except (np.linalg.LinAlgError, ArpackError, RuntimeError):
        raise mesh.refuse("its stiffness leaves a part of the body loose.") from None
    if squares.size and squares[0] < LOOSE * float((mesh.stiffness.diagonal() / mesh.mass.diagonal()).max()):
        raise mesh.refuse("its stiffness leaves a part of the body loose.")
    columns = np.zeros((rows, len(squares)))
    columns[places] = shapes
    return squares, columns


def _all_modes(mass: Array, stiffness: Array, rigid: Array | None) -> tuple[Array, Array]:
    """Of the flexibility, which keeps the lowest exact; rigid motions are stiffened beyond all others."""
    left_out = 0
    if rigid is not None:
        left_out = rigid.shape[1]
        held = mass @ rigid @ np.linalg.inv(np.linalg.cholesky(rigid.T @ mass @ rigid)).T
        highest = float((stiffness.diagonal() / mass.diagonal()).max())
        stiffness = stiffness + highest * held @ held.T
    inverse, shapes = eigh(mass, stiffness)
    inverse, shapes = inverse[left_out:][::-1], shapes[:, left_out:][:, ::-1]
    return 1 / inverse, shapes / np.sqrt(inverse)


def _lowest_modes(
    mass: sparse.csr_array, stiffness: sparse.csr_array, rigid: Array | None, body: ModalBody
) -> tuple[Array, Array]:
    """By inverse iteration about zero, a little below it where rigid motions are there; these left out."""
    rows = mass.shape[0]
    left_out = 0 if rigid is None else rigid.shape[1]
    below = 0.0 if rigid is None else -1e-8 * float((stiffness.diagonal() / mass.diagonal()).max())
    start = np.linspace(1.0, 2.0, rows)
    asked = (body.modes or 0) + SPARE + left_out
    highest = np.inf if body.highest_frequency is None else (2 * np.pi * body.highest_frequency) ** 2
    while True:
        asked = min(asked, rows // 2)
        squares, shapes = eigsh(
            sparse.csc_array(stiffness), asked, M=sparse.csc_array(mass), sigma=below, v0=start
        )
        order = np.argsort(squares)[left_out:]
        squares, shapes = squares[order], shapes[:, order]
        if body.modes is not None or asked == rows // 2 or squares[-1] > highest:
            break
        asked *= 2
    if rigid is not None:
        moved = rigid.T @ (mass @ shapes)
        shapes = shapes - rigid @ np.linalg.solve(rigid.T @ (mass @ rigid), moved)
    return squares, shapes


def _kept(mesh: _Mesh, body: ModalBody, squares: Array) -> int:
    count = kept_modes(body, np.sqrt(squares))
    if count > len(squares):
        raise mesh.refuse(f"modes = {count}, but the body has only {len(squares)} of them.")
    return count


def _oriented(mesh: _Mesh, squares: Array, columns: Array, tip: int) -> Array:
    """Modes with their signs, those of equal frequency turned: the first moves the tip along x, else y, z."""
    row = tip * mesh.freedoms

    def turn(group: Array) -> Array:
        return _lower(group[row : row + 3])

    columns = settled(columns, squares, turn)
    parts = columns.reshape(len(mesh.nodes), mesh.freedoms, -1)
    return columns * signed(parts[:, :3], parts[:, 3:], mesh.size)


def _lower(tip: Array) -> Array:
    """An orthogonal matrix that makes the tip's rows x, y, z lower triangular where they are not zero."""
    least = np.abs(tip).max(initial=0.0) * np.sqrt(SINGLE)
    basis = np.zeros((tip.shape[1], 0))
    for row in (*tip, *np.eye(tip.shape[1])):
        rest = row - basis @ (basis.T @ row)
        size = float(np.linalg.norm(rest))
        if basis.shape[1] < tip.shape[1] and size > max(least, SINGLE * float(np.linalg.norm(row))):
            basis = np.column_stack([basis, rest / size])
    return basis


def _turns(mesh: _Mesh, body: ModalBody, parts: Array) -> Array:
    """Rotation of nodes without rotations, with their nearest neighbours, shape (N, 3, s).

    The rotation that fits the neighbours' displacements best, and the smallest where they are in line;
    clamped nodes do not turn.
    """
    count = min(NEIGHBOURS + 1, len(mesh.nodes))
    found = np.zeros((len(mesh.nodes), 3, parts.shape[2]))
    for k, near in enumerate(KDTree(mesh.nodes).query(mesh.nodes, k=count)[1]):
        if body.boundary == "clamped" and k in body.roots:
            continue
        arms = np.vstack([-skew(arm) for arm in mesh.nodes[near] - mesh.nodes[k]])
        moved = (parts[near, :3] - parts[k, :3]).reshape(-1, parts.shape[2])
        # Normal equations cut at 1e-6 are singular values cut at 1e-3.
        found[k] = np.linalg.lstsq(arms, moved, rcond=np.sqrt(SINGLE))[0]
    return found


def _points(mesh: _Mesh, parts: Array) -> Points:
    """The nodes and, for those with rotations, three points each at a distance of the body's size.

    The direction e_a of a node is d_a = (u_na - u_n) / l + e_a in the rotated body. With the rotary inertia J
    between two nodes, ``sum (tr J / 2 - J)_ac d_a.d_c`` is the sum over the points that make it up.
    """
    step, count = mesh.freedoms, len(mesh.nodes)
    linear = sparse.csr_array(sum(mesh.mass[a::step, a::step] for a in range(3)) / 3)
    if step < SIX:
        return Points(mesh.nodes, linear, parts[:, :3].copy())
    arm = mesh.size
    places, modes = [mesh.nodes], [parts[:, :3]]
    for direction in np.eye(3):
        places.append(mesh.nodes + arm * direction)
        modes.append(parts[:, :3] - arm * np.einsum("ab,nbs->nas", skew(direction), parts[:, 3:]))
    rotary = [[mesh.mass[3 + a :: step, 3 + c :: step] for c in range(3)] for a in range(3)]
    half = 0.5 * (rotary[0][0] + rotary[1][1] + rotary[2][2])
    weights = sparse.block_array(
        [[(half - rotary[a][c] if a == c else -rotary[a][c]) for c in range(3)] for a in range(3)]
    )
    apart = sparse.hstack(
        [sparse.kron(np.ones((3, 1)), -sparse.eye_array(count)), sparse.eye_array(3 * count)]
    )
    masses = sparse.block_diag([linear, sparse.csr_array((3 * count, 3 * count))])
    masses = masses + apart.T @ weights @ apart / arm**2
    return Points(np.vstack(places), sparse.csr_array(masses), np.concatenate(modes))


def _first(whole: Array) -> Array:
    """First moment of a rigid body's mass matrix."""
    found: Array = 0.5 * axial(whole[:3, 3:])
    return found


def _surplus(points: Points, whole: Array, coupling: Array) -> Surplus | None:
    """Inertia of rigid motions and modes in the matrices, minus that of the points."""
    own, count = moments_of(points), coupling.shape[1]
    pairs = (
        (_first(whole), own.first[:, 0]),
        (0.5 * (whole[3:, 3:] + whole[3:, 3:].T), own.inertia),
        (coupling[:3], own.first[:, 1:]),
        (coupling[3:], own.turning),
        (np.eye(count), own.modal),
    )
    sizes = [max(float(np.abs(a).max()), float(np.abs(b).max())) for a, b in pairs]
    parts = [a - b for a, b in pairs]
    # Momenta per modal rate are small beside the body's where modes do not move it: sqrt of its inertia.
    sizes[2] = max(sizes[2], np.sqrt(own.mass))
    sizes[3] = max(sizes[3], float(np.sqrt(np.abs(own.inertia).max())))
    if all(np.abs(part).max() <= ROUNDING * size for part, size in zip(parts, sizes)):
        return None
    first, inertia, slide, turn, modal = parts
    return replace(Surplus.none(count), first=first, inertia=inertia, slide=slide, turn=turn, modal=modal)
