"""Modes of a body whose mass and stiffness matrices come from other finite element software."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import KDTree

from reference_model.flexible.mesh import ALL_SIX, Mesh, cross_matrices, rigid_motions
from reference_model.flexible.modes import LOOSE_PART, Keep, Modes, equal_groups, lowest_modes
from robot_model import InputError, ModalBody, read_modal_file

__all__ = ["imported_mesh", "imported_modes", "node_rotations"]

Matrix = NDArray[np.float64]

#: Relative tolerance for quantities that should be zero, allowing for files of single precision.
SINGLE = 1e-6

#: Lowest over highest frequency squared below which a held body still has a rigid motion.
LOOSE = 1e-14

#: Neighbours from whose displacements the rotation of a node without rotations is found.
NEIGHBOURS = 12


def imported_mesh(body: ModalBody, where: str) -> Mesh:
    """The body of the file, checked to be a free one.

    Args:
        body: names the file and its nodes.
        where: beginning of an error message about it.

    Raises:
        InputError: the file cannot be used, a node is out of range, or the body is held already.
    """
    try:
        found = read_modal_file(body.file)
    except InputError as error:
        raise InputError(f"{where.partition(',')[0]}: {error}") from None
    nodes = len(found.nodes)
    for key, node in (*(("root", root) for root in body.roots), ("tip", body.tip)):
        if node is not None and node >= nodes:
            raise InputError(f"{where}: {key} = {node}, but the file has nodes 0 to {nodes - 1}.")
    mesh = Mesh(found.nodes, found.mass, found.stiffness, found.mass.shape[0] // nodes)
    _weighs_alike(mesh, where)
    _floats(mesh, where)
    if body.boundary == "free":
        _begins_at_the_frame(body, mesh, where)
    return mesh


def _weighs_alike(mesh: Mesh, where: str) -> None:
    motions = rigid_motions(mesh.nodes, mesh.freedoms)[:, :3]
    masses = motions.T @ (mesh.mass @ motions)
    mean = float(np.trace(masses)) / 3
    if np.abs(masses - mean * np.eye(3)).max() > SINGLE * mean:
        along = ", ".join(f"{value:.6g}" for value in np.diag(masses))
        raise InputError(
            f"{where}: mass is {along} kg along x, y, z, which must be one and the same mass; give the "
            "matrix of the free body, its degrees of freedom in the order node by node."
        )


def _floats(mesh: Mesh, where: str) -> None:
    """A rigid motion of a free body costs no energy."""
    motions = rigid_motions(mesh.nodes, mesh.freedoms)
    forces = np.abs(mesh.stiffness @ motions)
    summed = abs(mesh.stiffness) @ np.abs(motions)
    if (forces > SINGLE * summed.max(axis=0)).any():
        raise InputError(
            f"{where}: stiffness resists a rigid motion of the body; give the matrix of the free body "
            "(`root` is clamped here), its degrees of freedom in the order node by node."
        )


def _begins_at_the_frame(body: ModalBody, mesh: Mesh, where: str) -> None:
    root = mesh.nodes[body.roots[0]]
    if np.linalg.norm(root) > SINGLE * float(np.linalg.norm(np.ptp(mesh.nodes, axis=0))):
        raise InputError(
            f"{where}: root is at {[round(float(x), 9) for x in root]}, but a body with free modes has its "
            "root at its frame's origin; move the nodes."
        )


def imported_modes(body: ModalBody, mesh: Mesh, keep: Keep, where: str) -> Modes:
    """Modes of the body clamped at its root nodes, or of the free body, shapes (d N, s).

    Modes of equal frequency are rotated within their subspace until the first moves the tip along one axis
    only, so that they are the same in repeated runs.

    Raises:
        InputError: the body can still move rigidly when its root nodes are held, or has a mechanism.
    """
    rows = len(mesh.nodes) * mesh.freedoms
    moving = np.ones(rows, dtype=bool)
    rigid = rigid_motions(mesh.nodes, mesh.freedoms)
    if body.boundary == "clamped":
        moving[_rows_of(body.roots, mesh.freedoms)] = False
        _holds(rigid[~moving], body, mesh, where)
    places = np.flatnonzero(moving)
    try:
        part = lowest_modes(
            sparse.csr_array(mesh.stiffness[places][:, places]),
            sparse.csr_array(mesh.mass[places][:, places]),
            keep=keep,
            rigid=rigid if body.boundary == "free" else None,
        )
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    _is_one_piece(part, mesh, where)
    shapes = np.zeros((rows, len(part.squares)))
    shapes[places] = part.shapes
    tip = len(mesh.nodes) - 1 if body.tip is None else body.tip
    shapes = _oriented(part.squares, shapes, tip * mesh.freedoms)
    kept = keep.select(part.squares)
    return Modes(part.squares[:kept], shapes[:, :kept])


def _rows_of(nodes: tuple[int, ...], freedoms: int) -> NDArray[np.intp]:
    return (np.array(nodes)[:, None] * freedoms + np.arange(freedoms)).ravel()


def _holds(held: Matrix, body: ModalBody, mesh: Mesh, where: str) -> None:
    """Whether every rigid motion moves a held degree of freedom; raises `InputError` if not."""
    size = float(np.linalg.norm(np.ptp(mesh.nodes, axis=0)))
    scaled = held / np.array([1, 1, 1, size, size, size])
    if np.linalg.matrix_rank(scaled, tol=SINGLE) < ALL_SIX:
        raise InputError(
            f"{where}: holding root = {list(body.roots)} leaves the body free to turn, since its nodes have "
            "no rotations; name three or more nodes of the root that are not in line, or use free modes."
        )


def _is_one_piece(modes: Modes, mesh: Mesh, where: str) -> None:
    """A frequency of zero is a mechanism: a loose node, or unconnected parts."""
    highest = float((mesh.stiffness.diagonal() / mesh.mass.diagonal()).max())
    if len(modes.squares) and modes.squares[0] < LOOSE * highest:
        raise InputError(f"{where}: {LOOSE_PART}")


def _oriented(squares: Matrix, shapes: Matrix, tip_row: int) -> Matrix:
    """Shapes, with those of equal frequency rotated so that the tip's x, else y, else z fixes the first."""
    shapes = shapes.copy()
    for group in equal_groups(squares):
        turn = _turn(shapes[tip_row : tip_row + 3, group])
        shapes[:, group] = shapes[:, group] @ turn
    return shapes


def _turn(tip: Matrix) -> Matrix:
    """An orthogonal matrix that makes `tip`, rows x, y, z, lower triangular in its non-zero rows."""
    large = np.abs(tip).max() * np.sqrt(SINGLE)
    basis: list[Matrix] = []
    for row in [*tip, *np.eye(tip.shape[1])]:
        left = row - sum((part * (part @ row) for part in basis), np.zeros_like(row))
        if len(basis) < len(row) and np.linalg.norm(left) > max(large, SINGLE * np.linalg.norm(row)):
            basis.append(left / np.linalg.norm(left))
    return np.column_stack(basis)


def node_rotations(body: ModalBody, mesh: Mesh, shapes: Matrix) -> Matrix:
    """Rotation of every node per modal coordinate, shape (N, 3, s) [1/(m sqrt(kg))].

    A node without rotations rotates with its nearest neighbours: the rotation w that best fits their
    displacements w x (r_n - r_k), and the smallest one where they are in line. Clamped nodes do not rotate.
    """
    parts = shapes.reshape(len(mesh.nodes), mesh.freedoms, -1)
    if mesh.freedoms == ALL_SIX:
        return parts[:, 3:]
    turns = _turns_with_neighbours(mesh, parts)
    if body.boundary == "clamped":
        turns[list(body.roots)] = 0.0
    return turns


def _turns_with_neighbours(mesh: Mesh, parts: Matrix) -> Matrix:
    count = min(NEIGHBOURS + 1, len(mesh.nodes))
    near = np.atleast_2d(KDTree(mesh.nodes).query(mesh.nodes, k=count)[1]).reshape(len(mesh.nodes), count)
    arms = mesh.nodes[near] - mesh.nodes[:, None]  # (N, k, 3)
    moved = parts[near] - parts[:, None]  # (N, k, 3, s)
    crossed = cross_matrices(arms)
    weights = np.einsum("nkba,nkbc->nac", crossed, crossed)
    turns: Matrix = np.linalg.pinv(weights, rcond=SINGLE, hermitian=True) @ np.einsum(
        "nkab,nkbs->nas", crossed, moved
    )
    return turns
