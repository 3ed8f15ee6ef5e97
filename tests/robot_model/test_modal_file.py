"""The file of a modal body: its contents are read, and any mistake gives one error message."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from scipy import sparse

from robot_model import InputError, load_robot, modal_file, read_modal_file

NODES = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])


def springs() -> tuple[np.ndarray, np.ndarray]:
    """Three points in a row with springs of 10 N/m between neighbours, each direction by itself."""
    chain = np.array([[1.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
    return np.kron(np.diag([1.0, 2.0, 1.0]), np.eye(3)), np.kron(10 * chain, np.eye(3))


MASS, STIFFNESS = springs()


def written(path: Path, **arrays: object) -> Path:
    given = {"nodes": NODES, "mass": MASS, "stiffness": STIFFNESS, **arrays}
    np.savez(path, **{name: array for name, array in given.items() if array is not None})
    return path


def rows_of(name: str, matrix: np.ndarray) -> dict[str, np.ndarray]:
    packed = sparse.csr_array(matrix)
    return {f"{name}_{part}": getattr(packed, part) for part in ("data", "indices", "indptr")}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "body.npz"


def test_dense_and_sparse_matrices(path: Path) -> None:
    dense = read_modal_file(written(path))
    assert np.array_equal(dense.nodes, NODES)
    assert np.array_equal(dense.mass.toarray(), MASS)
    assert np.array_equal(dense.stiffness.toarray(), STIFFNESS)
    packed = read_modal_file(written(path, mass=None, **rows_of("mass", MASS)))
    assert np.array_equal(packed.mass.toarray(), MASS)


def test_six_degrees_of_freedom(path: Path) -> None:
    mass, stiffness = np.eye(18), np.kron(STIFFNESS, np.eye(2))
    assert read_modal_file(written(path, mass=mass, stiffness=stiffness)).mass.shape == (18, 18)


@pytest.mark.parametrize("kind", ["<f4", ">f8", "<i4", "<u2"])
def test_any_kind_of_real_number(path: Path, kind: str) -> None:
    found = read_modal_file(written(path, mass=MASS.astype(kind), nodes=NODES.astype(kind)))
    assert found.mass.toarray() == pytest.approx(MASS)
    assert found.nodes.dtype == np.float64


def test_column_order_and_compression(path: Path) -> None:
    np.savez_compressed(path, nodes=np.asfortranarray(NODES), mass=MASS, stiffness=STIFFNESS)
    assert np.array_equal(read_modal_file(path).nodes, NODES)


def test_single_precision_rounding_is_not_an_asymmetry(path: Path) -> None:
    found = read_modal_file(written(path, stiffness=STIFFNESS + 1e-6 * np.arange(81).reshape(9, 9) / 81))
    assert np.array_equal(found.stiffness.toarray(), found.stiffness.toarray().T)


def changed(matrix: np.ndarray, row: int, column: int, value: float) -> np.ndarray:
    matrix = matrix.copy()
    matrix[row, column] = value
    return matrix


SPARSE = rows_of("mass", MASS)

REFUSALS = {
    "array missing": ({"mass": None}, " has no array 'mass'."),
    "array misspelt": ({"nodes": None, "node": NODES}, " has no array 'nodes'; did you mean 'node'?"),
    "part of a sparse matrix missing": (
        {"mass": None, "mass_data": SPARSE["mass_data"], "mass_indptr": SPARSE["mass_indptr"]},
        " has no array 'mass_indices'; did you mean 'mass_indptr'?",
    ),
    "nodes in a plane": ({"nodes": NODES[:, :2]}, ": nodes is 3 x 2; it needs N x 3, two nodes or more."),
    "one node": ({"nodes": NODES[:1]}, ": nodes is 1 x 3; it needs N x 3, two nodes or more."),
    "nodes at one place": (
        {"nodes": np.ones((3, 3))},
        ": nodes all lie at one place, so that the body has no size.",
    ),
    "not square": (
        {"mass": MASS[:, :8]},
        ": mass is 9 x 8; 3 nodes need 9 or 18 rows and as many columns.",
    ),
    "rows that fit no node": (
        {"mass": np.eye(12)},
        ": mass is 12 x 12; 3 nodes need 9 or 18 rows and as many columns.",
    ),
    "a column": ({"mass": np.ones(9)}, ": mass is 9; it needs rows and columns."),
    "two sizes": (
        {"mass": np.eye(18)},
        ": mass is 18 x 18 but stiffness 9 x 9; both need the same degrees of freedom.",
    ),
    "not symmetric": (
        {"stiffness": changed(STIFFNESS, 0, 3, 7.0)},
        ": stiffness is not symmetric: row 0, column 3 holds 7, but row 3, column 0 holds -10.",
    ),
    "without mass": (
        {"mass": changed(MASS, 4, 4, 0.0)},
        ": mass is not positive definite (its smallest diagonal entry, in row 4, is 0); every degree of "
        "freedom needs some mass.",
    ),
    "mass indefinite": (
        {"mass": changed(changed(MASS, 0, 1, 5.0), 1, 0, 5.0)},
        ": mass is not positive definite (its smallest diagonal entry, in row 0, is 1); every degree of "
        "freedom needs some mass.",
    ),
    "stiffness indefinite": (
        {"stiffness": STIFFNESS - 0.1 * np.eye(9)},
        ": stiffness is not positive semi-definite, so that the body would spring apart; check it.",
    ),
    "no stiffness": (
        {"stiffness": 0 * STIFFNESS},
        ": the largest diagonal entry of stiffness, for each unit of mass, is 0; a flexible body has some "
        "stiffness and some mass.",
    ),
    "not a number": (
        {"stiffness": changed(STIFFNESS, 2, 2, np.nan)},
        ": stiffness holds nan (one of 1 entries that are not finite or beyond all measure).",
    ),
    "infinite": (
        {"nodes": changed(NODES, 2, 0, np.inf)},
        ": nodes holds inf (one of 1 entries that are not finite or beyond all measure).",
    ),
    "complex": ({"mass": MASS + 0j}, ": mass holds complex128, not real numbers."),
    "text": ({"nodes": np.array(["a", "b"])}, ": nodes holds <U1, not real numbers."),
    "indices beyond": (
        {"mass": None, **SPARSE, "mass_indices": SPARSE["mass_indices"] + 1},
        ": mass_data, mass_indices and mass_indptr are no compressed rows of a square matrix.",
    ),
    "rows that fall": (
        {"mass": None, **SPARSE, "mass_indptr": SPARSE["mass_indptr"][::-1]},
        ": mass_data, mass_indices and mass_indptr are no compressed rows of a square matrix.",
    ),
    "rows that begin late": (
        {"mass": None, **SPARSE, "mass_indptr": np.maximum(SPARSE["mass_indptr"], 1)},
        ": mass_data, mass_indices and mass_indptr are no compressed rows of a square matrix.",
    ),
    "indices with fractions": (
        {"mass": None, **SPARSE, "mass_indices": np.zeros(9)},
        ": mass_indices must hold whole numbers (it holds float64).",
    ),
}


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        read_modal_file(path)
    return str(caught.value)


@pytest.mark.parametrize("kind", REFUSALS)
def test_refusal(path: Path, kind: str) -> None:
    arrays, sentence = REFUSALS[kind]
    assert refusal(written(path, **arrays)) == f"{path}{sentence}"


def test_python_objects_are_refused_unread(path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple:
            raise AssertionError("it was pickled again")

        def __setstate__(self, state: object) -> None:
            raise AssertionError("it was run")

    written(path, mass=np.array([{"a": 1}], dtype=object))
    assert refusal(path) == f"{path}: mass holds object, not real numbers."


def test_a_missing_file(path: Path) -> None:
    assert refusal(path) == f"{path} is no file; modal.file is looked for beside the robot file."


def test_a_folder(tmp_path: Path) -> None:
    assert refusal(tmp_path).endswith("cannot be read: Is a directory.")


def test_something_else(path: Path) -> None:
    path.write_bytes(b"mass = 1")
    assert refusal(path).startswith(f"{path} is not an NPZ file, or a damaged one: ")


def test_a_decompression_bomb_is_not_unpacked(path: Path) -> None:
    """Two gibibytes of zeros in some kilobytes; a header that claims more than is there."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (2**28, 1)}
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("nodes.npy", header.getvalue() + bytes(8))
    assert refusal(path).endswith("an array may have 512 MiB. Reduce the mesh, or give sparse matrices.")


def test_large_dense_matrices_are_refused_in_favour_of_sparse_ones(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(modal_file, "MOST_DENSE_ROWS", 8)
    assert refusal(written(path)).endswith(
        "mass is 9 x 9; above 8 rows give it as mass_data, mass_indices, mass_indptr (compressed rows)."
    )
    monkeypatch.setattr(modal_file, "MOST_NODES", 2)
    assert refusal(written(path)).endswith("nodes has 3 of them and may have 2; reduce the mesh.")


def test_large_matrices_pass_the_same_checks(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(modal_file, "DENSE_ROWS", 2)
    assert read_modal_file(written(path)).mass.shape == (9, 9)
    for kind in ("without mass", "mass indefinite", "stiffness indefinite"):
        arrays, sentence = REFUSALS[kind]
        assert refusal(written(path, **arrays)) == f"{path}{sentence}"


WHOLE = io.BytesIO()
np.savez(WHOLE, nodes=NODES, mass=MASS, stiffness=STIFFNESS)


@pytest.mark.fuzz
@given(
    places=st.lists(st.integers(0, len(WHOLE.getvalue()) - 1), min_size=1, max_size=6),
    values=st.lists(st.integers(0, 255), min_size=6, max_size=6),
    end=st.none() | st.integers(0, len(WHOLE.getvalue())),
)
def test_damaged_files(path: Path, places: list[int], values: list[int], end: int | None) -> None:
    """Bytes changed or cut off: the file is read, or rejected with one error message."""
    data = bytearray(WHOLE.getvalue())
    for place, value in zip(places, values):
        data[place] = value
    path.write_bytes(bytes(data[:end]))
    read_or_rejected(path)


def read_or_rejected(path: Path) -> None:
    refused = ""
    try:
        found = read_modal_file(path)
    except InputError as error:
        refused = str(error)
    if refused:
        assert refused.isprintable()
        assert str(path) in refused
    else:
        assert np.linalg.eigvalsh(found.mass.toarray()).min() > 0


arrays = npst.arrays(
    dtype=st.one_of(npst.floating_dtypes(), npst.integer_dtypes(), npst.boolean_dtypes()),
    shape=npst.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=9),
)


@pytest.mark.fuzz
@given(
    given=st.dictionaries(
        st.sampled_from(["nodes", "mass", "stiffness", *SPARSE]), arrays, min_size=1, max_size=4
    )
)
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")  # of the cast from float128
def test_arrays_of_any_kind(path: Path, given: dict[str, np.ndarray]) -> None:
    read_or_rejected(written(path, **given))


@pytest.mark.fuzz
@given(
    where=st.tuples(st.integers(0, 8), st.integers(0, 8)),
    value=st.floats(),
    name=st.sampled_from(["mass", "stiffness"]),
)
def test_one_entry_of_any_value(path: Path, where: tuple[int, int], value: float, name: str) -> None:
    row, column = where
    matrix = changed(
        changed({"mass": MASS, "stiffness": STIFFNESS}[name], row, column, value), column, row, value
    )
    read_or_rejected(written(path, **{name: matrix}))


ROBOT = """
name = "arm"
links = [ { name = "link1", modal = { file = "parts/body.npz", modes = 1 } } ]
joints = [ { name = "joint1", parent = "base", child = "link1" } ]
"""


def test_the_path_is_relative_to_the_robot_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "parts").mkdir()
    written(tmp_path / "parts" / "body.npz")
    (tmp_path / "arm.toml").write_text(ROBOT)
    monkeypatch.chdir(tmp_path)
    modal = load_robot("arm.toml").links[0].modal
    assert modal is not None
    assert modal.file == str(tmp_path / "parts" / "body.npz")


def test_a_misspelt_file_suggests_the_nearest(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    written(tmp_path / "parts" / "boby.npz")
    robot = tmp_path / "arm.toml"
    robot.write_text(ROBOT)
    with pytest.raises(InputError) as caught:
        load_robot(robot)
    assert str(caught.value) == (
        f"{robot}: links[link1].modal.file: 'parts/body.npz' is no file beside it; did you mean 'boby.npz'?"
    )
