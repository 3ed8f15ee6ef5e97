"""Natural modes: the lowest solutions of K v = w^2 M v, mass-normalised, with reproducible signs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh, splu

from robot_model import InputError

__all__ = [
    "DENSE_ROWS",
    "LOOSE_PART",
    "Keep",
    "Modes",
    "equal_groups",
    "lowest_modes",
    "sorted_modes",
    "with_fixed_signs",
]

Matrix = NDArray[np.float64]

#: Up to this many rows a dense solution takes a second or less; beyond it only the lowest are computed.
DENSE_ROWS = 1500

#: Frequencies squared that differ by less than this fraction count as equal: rounding of a fine mesh.
EQUAL = 1e-6

#: Two amplitudes that differ by less than this fraction count as equal when the larger one fixes a sign.
AS_LARGE = 1e-6

#: Modes beyond those wanted, so that a group of equal frequencies is complete before it is oriented.
SPARE = 6

#: Fraction by which a frequency limit is widened, so that rounding does not split a pair of equal ones.
MARGIN = 1e-5

#: Error message for a stiffness of zero after removal of the rigid motions.
LOOSE_PART = (
    "a part of the body moves without being deformed; stiffness must leave no motion free but that of the "
    "whole body."
)

#: Shift that makes a free body's stiffness regular, relative to its highest eigenvalue: above rounding.
SHIFT = 1e-10


@dataclass(frozen=True)
class Keep:
    """Which modes are kept: the `count` lowest, or those with squares up to `highest` [rad^2/s^2]."""

    count: int | None = None
    highest: float | None = None

    def select(self, squares: Matrix) -> int:
        """Number of kept modes among the increasing squares."""
        if self.count is not None:
            return self.count
        assert self.highest is not None
        return int(np.searchsorted(squares, self.highest, side="right"))


@dataclass(frozen=True)
class Modes:
    """Squares of natural frequencies [rad^2/s^2], shape (s,), and shapes [1/sqrt(kg)], (rows, s)."""

    squares: Matrix
    shapes: Matrix


def lowest_modes(
    stiffness: Matrix | sparse.csr_array,
    mass: Matrix | sparse.csr_array,
    *,
    keep: Keep,
    rigid: Matrix | None = None,
) -> Modes:
    """The lowest modes, mass-normalised, with a few to spare; fewer where the matrices have no more.

    Args:
        stiffness, mass: square and symmetric, mass positive definite.
        keep: how many are wanted at least.
        rigid: rigid motions as columns, which are no modes: all modes are made orthogonal to them.

    Raises:
        InputError: stiffness is singular, or the iteration for large sparse matrices fails.
    """
    if stiffness.shape[0] <= DENSE_ROWS:
        return _dense(_full(stiffness), _full(mass), keep, rigid)
    return _iterated(sparse.csc_array(stiffness), sparse.csc_array(mass), keep, rigid)


def _full(matrix: Matrix | sparse.csr_array) -> Matrix:
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def _dense(stiffness: Matrix, mass: Matrix, keep: Keep, rigid: Matrix | None) -> Modes:
    """Modes in the complement of the rigid motions, where no eigenvalue is zero."""
    if rigid is None:
        return _definite(stiffness, mass, keep)
    basis = linalg.qr(mass @ rigid)[0][:, rigid.shape[1] :]
    part = _definite(basis.T @ stiffness @ basis, basis.T @ mass @ basis, keep)
    return Modes(part.squares, basis @ part.shapes)


def _definite(stiffness: Matrix, mass: Matrix, keep: Keep) -> Modes:
    """Modes from M v = (1/w^2) K v where few are wanted, which keeps rounding errors of the lowest small.

    K v = w^2 M v has rounding errors relative to the highest frequency of the mesh, which with a heavy tip
    and many elements is a million times the first.
    """
    rows = len(stiffness)
    wanted = rows if keep.count is None else min(keep.count + SPARE, rows)
    try:
        if keep.count is not None and 2 * wanted > rows:
            return Modes(*linalg.eigh(stiffness, mass, subset_by_index=(0, wanted - 1)))
        chosen: dict[str, Any] = {"subset_by_index": (rows - wanted, rows - 1)}
        if keep.highest is not None:
            chosen = {"subset_by_value": ((1 - MARGIN) / keep.highest, np.inf)}
        inverse, shapes = linalg.eigh(mass, stiffness, **chosen)
    except np.linalg.LinAlgError:
        raise InputError(LOOSE_PART) from None
    return Modes(1 / inverse[::-1], (shapes / np.sqrt(inverse))[:, ::-1])


def _iterated(stiffness: sparse.csc_array, mass: sparse.csc_array, keep: Keep, rigid: Matrix | None) -> Modes:
    """By inverse iteration; more and more modes until enough are found."""
    rows = stiffness.shape[0]
    most = rows // 2
    asked = (keep.count or 0) + SPARE
    while True:
        asked = min(asked, most)
        try:
            squares, shapes = _by_inverse(stiffness, mass, asked, rigid)
        except (ArpackError, RuntimeError) as error:  # RuntimeError: the factorisation found it singular
            raise InputError(
                f"{asked} modes of the {rows} x {rows} matrices could not be found ({error}); check that "
                "stiffness leaves no part of the body loose, or ask for fewer modes."
            ) from None
        order = np.argsort(squares)
        modes = Modes(squares[order], shapes[:, order])
        if asked == most or keep.highest is None or modes.squares[-1] > keep.highest:
            return modes
        asked *= 2


def _by_inverse(
    stiffness: sparse.csc_array, mass: sparse.csc_array, count: int, rigid: Matrix | None
) -> tuple[Matrix, Matrix]:
    start = np.linspace(1.0, 2.0, stiffness.shape[0])  # fixed, so that repeated runs agree
    if rigid is None:
        return eigsh(stiffness, count, M=mass, sigma=0.0, v0=start)
    # A free body's stiffness is singular. It is shifted a little, and the rigid motions are removed from the
    # result of the shifted inverse, or they would dominate the others.
    motions = rigid @ np.linalg.inv(np.linalg.cholesky(rigid.T @ (mass @ rigid))).T
    forces = mass @ motions
    shift = -SHIFT * float((stiffness.diagonal() / mass.diagonal()).max())
    factors = splu(sparse.csc_array(stiffness - shift * mass))

    def solve(load: Matrix) -> Matrix:
        answer = factors.solve(load - forces @ (motions.T @ load))
        return answer - motions @ (forces.T @ answer)

    inverse = LinearOperator(stiffness.shape, matvec=solve, dtype=float)
    start -= motions @ (forces.T @ start)
    return eigsh(stiffness, count, M=mass, sigma=shift, OPinv=inverse, v0=start)


def sorted_modes(families: Sequence[Modes], keep: Keep) -> Modes:
    """All modes by increasing frequency, equal ones in the order of the families, then truncated."""
    squares = np.concatenate([modes.squares for modes in families])
    shapes = np.concatenate([modes.shapes for modes in families], axis=1)
    family = np.repeat(np.arange(len(families)), [len(modes.squares) for modes in families])
    order = np.argsort(squares, kind="stable")
    for group in equal_groups(squares[order]):
        order[group] = order[group][np.argsort(family[order[group]], kind="stable")]
    kept = order[: keep.select(squares[order])]
    return Modes(squares[kept], shapes[:, kept])


def equal_groups(squares: Matrix) -> list[slice]:
    """Groups of two or more increasing squares that are equal except for rounding."""
    edges = np.flatnonzero(np.diff(squares) > EQUAL * np.abs(squares[1:])) + 1
    starts, stops = [0, *edges], [*edges, len(squares)]
    return [slice(int(a), int(b)) for a, b in zip(starts, stops) if b - a > 1]


def with_fixed_signs(shapes: Matrix, freedoms: int, size: float) -> Matrix:
    """Shapes, each with the sign that makes its largest displacement positive.

    Of equally large displacements, the last node's decides. A mode without displacements, such as torsion,
    is judged by its rotations.

    Args:
        shapes: nodal displacements as columns, shape (freedoms N, s).
        freedoms: degrees of freedom for each node, 3 or 6.
        size: a length [m] that makes rotations comparable with displacements.
    """
    parts = shapes.reshape(-1, freedoms, shapes.shape[1])
    signs = [_sign(parts[:, :3, k].ravel(), size * parts[:, 3:, k].ravel()) for k in range(shapes.shape[1])]
    return shapes * np.array(signs)


def _sign(moves: Matrix, turns: Matrix) -> float:
    turning = turns.size and np.abs(moves).max() < AS_LARGE * np.abs(turns).max()
    values = turns if turning else moves
    large = np.flatnonzero(np.abs(values) >= (1 - AS_LARGE) * np.abs(values).max())
    return float(np.sign(values[large[-1]])) or 1.0
