"""Reading the NPZ file of a modal body: nodes, mass and stiffness matrices, checked, never a pickle."""

from __future__ import annotations

import os
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from robot_model.input.errors import InputError, nearest
from robot_model.input.memory import OutOfMemoryError

__all__ = ["ModalMatrices", "read_modal_file"]

#: A mesh of more nodes should be reduced by finite element software first; its modes would take minutes.
MOST_NODES = 20_000

#: A dense matrix of more rows takes hundreds of megabytes; larger ones are sparse.
MOST_DENSE_ROWS = 3000

#: Arrays of a sparse matrix of the largest mesh stay below this [bytes].
LARGEST_ARRAY = 512 * 2**20

#: Stiffness in SI units stays far below; sums and products of such figures do not overflow.
LARGEST_ENTRY = 1e24

#: Asymmetry of single precision files, relative to the largest entry of row and column.
SINGLE = 1e-6

#: An eigenvalue of the stiffness this far below zero, relative to the highest, is not just rounding.
NEGATIVE = 1e-6

#: Up to this many rows a dense factorisation is as quick as a sparse one.
DENSE_ROWS = 1500

#: Largest size of an array's header; numpy's own limit.
HEADER = 10_000


@dataclass(frozen=True)
class ModalMatrices:
    """Nodes and matrices of a free finite-element body.

    Attributes:
        nodes: positions in the link's frame [m], shape (N, 3).
        mass: symmetric and positive definite, shape (6 N, 6 N) or (3 N, 3 N), SI units.
        stiffness: symmetric and positive semi-definite, of the same shape.
    """

    nodes: NDArray[np.float64]
    mass: sparse.csr_array
    stiffness: sparse.csr_array


def read_modal_file(path: str | os.PathLike[str]) -> ModalMatrices:
    """The matrices of an NPZ file as described in `ModalBody`.

    Raises:
        InputError: no such file, damaged, an array missing, of a wrong shape, too large or not finite, a
            matrix not symmetric, mass not positive definite, stiffness not positive semi-definite.
    """
    with _opened(Path(path)) as arrays:
        nodes = _nodes(arrays)
        mass, stiffness = (_matrix(arrays, name, len(nodes)) for name in ("mass", "stiffness"))
    if mass.shape != stiffness.shape:
        raise InputError(
            f"{path}: mass is {_size(mass.shape)} but stiffness {_size(stiffness.shape)}; both need the same "
            "degrees of freedom."
        )
    _is_definite(mass, stiffness, path)
    return ModalMatrices(nodes, mass, stiffness)


@dataclass(frozen=True)
class _Arrays:
    """The arrays of an open NPZ file, read one by one, each after checking its size."""

    path: Path
    archive: zipfile.ZipFile

    def __contains__(self, name: str) -> bool:
        return f"{name}.npy" in self.archive.namelist()

    def read(self, name: str) -> NDArray[np.generic]:
        if name not in self:
            names = [item.removesuffix(".npy") for item in self.archive.namelist()]
            raise InputError(f"{self.path} has no array '{name}'{nearest(name, names)}.")
        size = self.archive.getinfo(f"{name}.npy").file_size
        with self.archive.open(f"{name}.npy") as stream:
            shape, fortran, kind = _header(stream)
            if kind.kind not in "fiu":
                raise InputError(f"{self.path}: {name} holds {kind}, not real numbers.")
            if size > LARGEST_ARRAY or prod(shape) * kind.itemsize > LARGEST_ARRAY:
                raise InputError(
                    f"{self.path}: {name} has {size / 2**20:.0f} MiB; an array may have "
                    f"{LARGEST_ARRAY / 2**20:.0f} MiB. Reduce the mesh, or give sparse matrices."
                )
            data = np.frombuffer(stream.read(), dtype=kind)
        if data.size != prod(shape):
            raise InputError(f"{self.path}: {name} holds {data.size} numbers but should hold {prod(shape)}.")
        return data.reshape(shape, order="F" if fortran else "C")


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    try:
        return read(stream, max_header_size=HEADER)
    except MemoryError:  # Python's own parser says so of too many signs in a row
        raise ValueError("an array has no header") from None


@contextmanager
def _opened(path: Path) -> Iterator[_Arrays]:
    """The file's arrays; every failure of the file is reported in one sentence."""
    try:
        with zipfile.ZipFile(path) as archive:
            yield _Arrays(path, archive)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path} is no file; modal.file is looked for beside the robot file.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise InputError(f"{path} is not an NPZ file, or a damaged one: {error}.") from None
    except MemoryError:
        raise OutOfMemoryError(f"{path} takes more memory than is free; close other programs.") from None
    except (ValueError, TypeError, SyntaxError, OverflowError) as error:
        raise InputError(f"{path} is not an NPZ file of arrays: {error}.") from None


def _size(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape)) or "a single number"


def _finite(arrays: _Arrays, name: str) -> NDArray[np.float64]:
    array = np.asarray(arrays.read(name), dtype=float)
    bad = ~(np.abs(array) <= LARGEST_ENTRY)
    if bad.any():
        raise InputError(
            f"{arrays.path}: {name} holds {array[bad][0]:g} (one of {bad.sum()} entries that are not finite "
            "or beyond all measure)."
        )
    return array


def _nodes(arrays: _Arrays) -> NDArray[np.float64]:
    nodes = _finite(arrays, "nodes")
    if nodes.ndim != 2 or nodes.shape[1] != 3 or len(nodes) < 2:
        raise InputError(f"{arrays.path}: nodes is {_size(nodes.shape)}; it needs N x 3, two nodes or more.")
    if len(nodes) > MOST_NODES:
        raise InputError(
            f"{arrays.path}: nodes has {len(nodes)} of them and may have {MOST_NODES}; reduce the mesh."
        )
    if np.ptp(nodes, axis=0).max() == 0:
        raise InputError(f"{arrays.path}: nodes all lie at one place, so that the body has no size.")
    return nodes


def _matrix(arrays: _Arrays, name: str, nodes: int) -> sparse.csr_array:
    matrix = _sparse(arrays, name) if f"{name}_data" in arrays else _dense(arrays, name)
    rows, columns = matrix.shape
    if rows != columns or rows not in (3 * nodes, 6 * nodes):
        raise InputError(
            f"{arrays.path}: {name} is {_size(matrix.shape)}; {nodes} nodes need {3 * nodes} or {6 * nodes} "
            "rows and as many columns."
        )
    _is_symmetric(arrays, name, matrix)
    return sparse.csr_array((matrix + matrix.T) / 2)


def _dense(arrays: _Arrays, name: str) -> sparse.csr_array:
    array = _finite(arrays, name)
    if array.ndim != 2:
        raise InputError(f"{arrays.path}: {name} is {_size(array.shape)}; it needs rows and columns.")
    if len(array) > MOST_DENSE_ROWS:
        raise InputError(
            f"{arrays.path}: {name} is {_size(array.shape)}; above {MOST_DENSE_ROWS} rows give it as "
            f"{name}_data, {name}_indices, {name}_indptr (compressed rows)."
        )
    return sparse.csr_array(array)


def _sparse(arrays: _Arrays, name: str) -> sparse.csr_array:
    """The matrix of compressed rows, with checked indices."""
    data = _finite(arrays, f"{name}_data")
    indices, pointers = (_whole(arrays, f"{name}_{part}") for part in ("indices", "indptr"))
    rows = len(pointers) - 1
    sound = (
        data.ndim == indices.ndim == pointers.ndim == 1
        and rows > 0
        and len(data) == len(indices) == pointers[-1]
        and pointers[0] == 0
        and (np.diff(pointers) >= 0).all()
        and (len(indices) == 0 or (indices.min() >= 0 and indices.max() < rows))
    )
    if not sound:
        raise InputError(
            f"{arrays.path}: {name}_data, {name}_indices and {name}_indptr are no compressed rows of a "
            "square matrix."
        )
    return sparse.csr_array((data, indices, pointers), shape=(rows, rows))


def _whole(arrays: _Arrays, name: str) -> NDArray[np.int64]:
    array = arrays.read(name)
    if array.dtype.kind not in "iu" or array.size == 0:
        raise InputError(f"{arrays.path}: {name} must hold whole numbers (it holds {array.dtype}).")
    return np.atleast_1d(array.astype(np.int64))


def _is_symmetric(arrays: _Arrays, name: str, matrix: sparse.csr_array) -> None:
    """Each entry relative to the larger of its two diagonal ones, since rows may have different units."""
    difference = sparse.coo_array(abs(matrix - matrix.T))
    diagonal = np.sqrt(np.abs(matrix.diagonal()))
    scale = np.maximum(diagonal[difference.coords[0]] * diagonal[difference.coords[1]], np.finfo(float).tiny)
    off = difference.data / scale
    if off.size and off.max() > SINGLE:
        row, column = (int(axis[off.argmax()]) for axis in difference.coords)
        raise InputError(
            f"{arrays.path}: {name} is not symmetric: row {row}, column {column} holds "
            f"{matrix[row, column]:.9g}, but row {column}, column {row} holds {matrix[column, row]:.9g}."
        )


def _is_definite(mass: sparse.csr_array, stiffness: sparse.csr_array, path: str | os.PathLike[str]) -> None:
    weights = mass.diagonal()
    if weights.min() <= 0 or not _is_positive(_scaled(mass, weights)):
        row = int(weights.argmin())
        raise InputError(
            f"{path}: mass is not positive definite (its smallest diagonal entry, in row {row}, is "
            f"{weights[row]:.6g}); every degree of freedom needs some mass."
        )
    shaped = _scaled(stiffness, weights)
    highest = float(shaped.diagonal().max())
    if not 0 < highest < np.inf:
        raise InputError(
            f"{path}: the largest diagonal entry of stiffness, for each unit of mass, is {highest:g}; a "
            "flexible body has some stiffness and some mass."
        )
    if not _is_positive(sparse.csr_array(shaped / highest + NEGATIVE * sparse.eye_array(mass.shape[0]))):
        raise InputError(
            f"{path}: stiffness is not positive semi-definite, so that the body would spring apart; check it."
        )


def _scaled(matrix: sparse.csr_array, weights: NDArray[np.float64]) -> sparse.csr_array:
    """The matrix for degrees of freedom of unit mass, in 1/s^2."""
    scale = sparse.diags_array(1 / np.sqrt(weights))
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # masses of nearly nothing; what is infinite is then not definite
        return sparse.csr_array(scale @ matrix @ scale)


def _is_positive(matrix: sparse.csr_array) -> bool:
    """Whether a symmetric matrix is positive definite: elimination has only positive pivots."""
    if not np.isfinite(matrix.data).all():
        return False
    if matrix.shape[0] <= DENSE_ROWS:
        try:
            np.linalg.cholesky(matrix.toarray())
        except np.linalg.LinAlgError:
            return False
        return True
    straight: dict[str, Any] = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0}
    try:
        factors = splu(sparse.csc_array(matrix), options={"SymmetricMode": True}, **straight)
    except RuntimeError:  # it is singular
        return False
    on_diagonal = (factors.perm_r == factors.perm_c).all()
    return bool(on_diagonal and (factors.U.diagonal() > 0).all())
