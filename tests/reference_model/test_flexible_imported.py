"""Bodies from external finite elements: a beam in a file, and a solid block."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flexible_links import beam_link
from solid_blocks import Block, save

from reference_model.flexible import FlexibleBody, flexible_body, modes
from reference_model.flexible.beam import beam_mesh
from reference_model.flexible.integrals import shape_integrals
from reference_model.flexible.mesh import Mesh, cross_matrices, rigid_motions
from robot_model import InputError, Link, ModalBody, Rectangle, TipBody

ARRAYS = ("first_moment", "inertia", "S0", "S1", "E", "F", "D", "P", "h", "damping", "frequencies")
FACE = tuple(range(9))  # nodes of a block's end at x = 0
CENTER = 4  # the one in the middle


def imported(path: Path, **keys: object) -> Link:
    rigid = {key: keys.pop(key) for key in ("mass", "inertia") if key in keys}
    modal = ModalBody(file=str(path), **{"modes": 8, **keys})  # type: ignore[arg-type]
    return Link(name="link1", modal=modal, **rigid)  # type: ignore[arg-type]


def block_body(tmp_path: Path, **keys: object) -> FlexibleBody:
    block = Block()
    path = save(tmp_path / "block.npz", block.nodes, *block.matrices)
    return flexible_body(imported(path, **{"root": FACE, **keys}))


@pytest.mark.parametrize("boundary", ["clamped", "free"])
@pytest.mark.parametrize("dense", [True, False])
def test_an_imported_beam_equals_the_described_one(tmp_path: Path, boundary: str, dense: bool) -> None:
    section = Rectangle(width=0.02, height=0.013)
    tip = TipBody(mass=1.0, inertia=(0.02, 0.03, 0.04))
    keys = {"modes": 8, "boundary": boundary, "damping_ratio": 0.01}
    skewed = {"direction": (1.0, 2.0, -2.0), "section_y": (2.0, 1.0, 2.0)}
    link = beam_link(section, elements=8, tip=tip, **keys, **skewed)
    assert link.beam is not None
    mesh = beam_mesh(link.beam)
    path = tmp_path / "beam.npz"
    if dense:
        np.savez(path, nodes=mesh.nodes, mass=mesh.mass.toarray(), stiffness=mesh.stiffness.toarray())
    else:
        save(path, mesh.nodes, mesh.mass, mesh.stiffness)
    one, other = flexible_body(link), flexible_body(imported(path, **keys))
    assert other.mass == pytest.approx(one.mass, rel=1e-12)
    # The frequencies lie 4 % apart or more, so that rounding of 1e-13 in the matrices stays below 1e-8.
    for name in ARRAYS:
        scale = np.abs(getattr(one, name)).max() if name not in ("S0", "S1", "P") else np.sqrt(one.mass)
        assert np.abs(getattr(other, name) - getattr(one, name)).max() <= 1e-8 * scale, name
    for name in ("translations", "rotations", "node_masses", "node_inertias", "nodes"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), abs=1e-8), name
    assert (other.root, other.tip) == (one.root, one.tip)


@pytest.mark.parametrize("boundary", ["clamped", "free"])
def test_large_meshes_are_solved_to_the_same_modes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, boundary: str
) -> None:
    dense = block_body(tmp_path, boundary=boundary, root=FACE if boundary == "clamped" else CENTER)
    monkeypatch.setattr(modes, "DENSE_ROWS", 10)
    (tmp_path / "again").mkdir()
    large = block_body(tmp_path / "again", boundary=boundary, root=FACE if boundary == "clamped" else CENTER)
    assert large.frequencies == pytest.approx(dense.frequencies, rel=1e-8)
    assert np.abs(large.S1 - dense.S1).max() < 1e-7
    assert np.abs(large.E - dense.E).max() < 1e-7
    highest = float(dense.frequencies[4] * 1.01 / (2 * np.pi))
    limited = block_body(tmp_path / "again", modes=None, highest_frequency=highest)
    assert limited.count == np.sum(block_body(tmp_path).frequencies <= 2 * np.pi * highest)


def test_integrals_of_a_solid_are_those_of_its_fields(tmp_path: Path) -> None:
    """Consistent mass: the integrals over the block of its shape functions' fields, by Gauss's rule."""
    block, body = Block(), block_body(tmp_path, modes=7)
    assert body.mass == pytest.approx(block.density * np.prod(block.size), rel=1e-12)
    a, b, c = block.size
    assert body.first_moment == pytest.approx([body.mass * a / 2, 0, 0], abs=1e-12)
    exact = np.diag([(b**2 + c**2) / 12, a**2 / 3 + c**2 / 12, a**2 / 3 + b**2 / 12])
    assert body.inertia == pytest.approx(body.mass * exact, abs=1e-9)
    sums = {name: np.zeros_like(getattr(body, name)) for name in ("S0", "S1", "E", "F", "D", "h")}
    for weight, shape, _ in block.points(3):
        for element in block.elements:
            dm = weight * block.density
            phi = np.einsum("n,nas->as", shape, body.translations[element])
            arm = cross_matrices(shape @ block.nodes[element])
            tilde = cross_matrices(phi.T)
            crossed = np.einsum("jab,bl->jal", tilde, phi)  # phi_j x phi_l
            sums["S0"] += dm * phi
            sums["S1"] += dm * arm @ phi
            sums["E"] += dm * arm @ tilde
            sums["F"] += dm * np.einsum("jab,lbc->jlac", tilde, tilde)
            sums["D"] += dm * crossed
            sums["h"] += dm * np.swapaxes(crossed, 1, 2)
    for name, expected in sums.items():
        assert np.abs(getattr(body, name) - expected).max() < 1e-11 * max(np.abs(expected).max(), 1), name
    assert np.abs(body.P).max() < 1e-12


def hermite_beam(elements: int, length: float = 1.0) -> Mesh:
    """A beam with the consistent mass of its cubic functions: displacements and rotations are coupled."""
    h = length / elements
    cubic = np.array(
        [
            [156, 22 * h, 54, -13 * h],
            [22 * h, 4 * h**2, 13 * h, -3 * h**2],
            [54, 13 * h, 156, -22 * h],
            [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
        ]
    )
    mirror = np.outer([1, -1, 1, -1], [1, -1, 1, -1])
    blocks = {
        (1, 5, 7, 11): cubic * h / 420,
        (2, 4, 8, 10): cubic * mirror * h / 420,
        (0, 6): np.array([[2, 1], [1, 2]]) * h / 6,
        (3, 9): np.array([[2, 1], [1, 2]]) * h / 6 * 1e-4,
    }
    mass = np.zeros((6 * (elements + 1),) * 2)
    for element in range(elements):
        for places, block in blocks.items():
            rows = np.array(places) + 6 * element
            mass[np.ix_(rows, rows)] += block
    nodes = np.linspace(0, length, elements + 1)[:, None] * np.array([1.0, 0, 0])
    return Mesh(nodes, mass, np.zeros_like(mass))  # type: ignore[arg-type]


def parabola(elements: int) -> np.ndarray:
    """Nodal displacements of v = x^2, w = x^2 / 2 and u = x, which the elements represent exactly."""
    x = np.linspace(0, 1, elements + 1)
    shapes = np.zeros((elements + 1, 6, 3))
    shapes[:, 1, 0], shapes[:, 5, 0] = x**2, 2 * x
    shapes[:, 2, 1], shapes[:, 4, 1] = x**2 / 2, -x
    shapes[:, 0, 2] = x
    return shapes.reshape(-1, 3)


def test_first_order_integrals_of_a_consistent_beam_are_exact() -> None:
    found = shape_integrals(hermite_beam(3), parabola(3))
    assert found.mass == pytest.approx(1.0)
    assert found.first_moment == pytest.approx([0.5, 0, 0])
    assert found.inertia == pytest.approx(np.diag([1e-4, 1 / 3, 1 / 3]))
    assert np.allclose(found.S0, [[0, 0, 1 / 2], [1 / 3, 0, 0], [0, 1 / 6, 0]])
    assert np.allclose(found.S1, [[0, 0, 0], [0, -1 / 8, 0], [1 / 4, 0, 0]])


def test_its_second_order_integrals_converge() -> None:
    """rho0~ phi~ = phi rho0^T - 1 rho0.phi: integral of x v = 1/4 and of x u = 1/3; h of v and w."""
    errors = []
    for elements in (8, 16):
        found = shape_integrals(hermite_beam(elements), parabola(elements))
        expected = np.array([found.E[0][1, 0] - 1 / 4, found.E[2][1, 1] + 1 / 3, found.h[0, 1, 0] - 1 / 10])
        errors.append(np.abs(expected))
    assert errors[1].max() < 2e-3
    assert (errors[0] / errors[1]).min() > 3.5  # second order


def kinetic_energy_of(body: FlexibleBody, mass: np.ndarray, x: np.ndarray, rates: np.ndarray) -> float:
    """From the velocities of the nodes, each where it is."""
    moved = body.nodes + body.translations @ x
    motions = rigid_motions(moved, mass.shape[0] // len(body.nodes))
    shapes = np.concatenate([body.translations, body.rotations], axis=1)
    shapes = shapes[:, : mass.shape[0] // len(body.nodes)].reshape(mass.shape[0], -1)
    velocity = motions @ rates[:6] + shapes @ rates[6:]
    return float(velocity @ mass @ velocity) / 2


def kinetic_energy_from(body: FlexibleBody, x: np.ndarray, rates: np.ndarray) -> float:
    """From the integrals, docs/theory.md 2."""
    v, omega, xd = rates[:3], rates[3:6], rates[6:]
    center = body.first_moment + body.S0 @ x
    first = np.einsum("j,jab->ab", x, body.E)
    inertia = body.inertia - first - first.T - np.einsum("j,l,jlab->ab", x, x, body.F)
    mixed = body.S1 + np.einsum("j,jal->al", x, body.D)
    square = body.mass * v @ v + omega @ inertia @ omega + xd @ xd
    return float(square / 2 + v @ np.cross(omega, center) + v @ body.S0 @ xd + omega @ mixed @ xd)


def test_kinetic_energy_of_a_deformed_solid(tmp_path: Path) -> None:
    mass = Block().matrices[0].toarray()
    random = np.random.default_rng(2)
    for boundary, root in (("clamped", FACE), ("free", CENTER)):
        body = block_body(tmp_path, boundary=boundary, root=root)
        for _ in range(5):
            x, rates = random.normal(size=body.count), random.normal(size=6 + body.count)
            expected = kinetic_energy_of(body, mass, x, rates)
            assert kinetic_energy_from(body, x, rates) == pytest.approx(expected, rel=1e-11)


def test_integrals_satisfy_the_conservation_identities() -> None:
    """E_j - E_j^T = (S1_j - P_j)~, F_jl - F_lj = h_jl~ and D_jl = -D_lj, else f2 and f3 of docs/theory.md 2
    are not the derivatives of one kinetic energy; they hold for any mass matrix."""
    random = np.random.default_rng(3)
    found = shape_integrals(hermite_beam(4), random.normal(size=(30, 5)))
    skew = found.E - np.swapaxes(found.E, 1, 2)
    assert skew == pytest.approx(cross_matrices((found.S1 - found.P).T), abs=1e-12)
    assert found.F - np.swapaxes(found.F, 0, 1) == pytest.approx(cross_matrices(found.h), abs=1e-12)
    assert np.abs(found.D + found.D.transpose(2, 1, 0)).max() < 1e-12


def test_mean_axis_conditions_of_a_free_solid(tmp_path: Path) -> None:
    body = block_body(tmp_path, boundary="free", root=CENTER)
    assert np.abs(body.S0).max() < 1e-9 * np.sqrt(body.mass)
    assert np.abs(body.S1).max() < 1e-9 * np.sqrt(body.mass)
    assert np.abs(body.translations[body.root]).max() > 0.01
    assert np.abs(body.rotations[body.root]).max() > 0.01


def test_rotations_of_nodes_without_them(tmp_path: Path) -> None:
    """Those that turn with the cross-section of a slender block in bending: theta_z = v', theta_y = -w'."""
    body = block_body(tmp_path, modes=2)
    ends = np.flatnonzero(body.nodes[:, 0] == 1.0)
    across = np.linalg.lstsq(
        np.column_stack([np.ones(9), -body.nodes[ends, 1], body.nodes[ends, 2]]),
        body.translations[ends, 0],
        rcond=None,
    )[0]
    turns = body.rotations[ends].mean(axis=0)
    assert turns[2] == pytest.approx(across[1], abs=0.1 * np.abs(across).max())
    assert turns[1] == pytest.approx(across[2], abs=0.1 * np.abs(across).max())
    assert not body.rotations[list(FACE)].any()


def test_equal_frequencies_are_oriented_by_the_tip(tmp_path: Path) -> None:
    block = Block(size=(1.0, 0.1, 0.1), cells=(6, 1, 1))
    path = save(tmp_path / "square.npz", block.nodes, *block.matrices)
    body = flexible_body(imported(path, root=(0, 1, 2, 3), modes=2))
    assert body.frequencies[0] == pytest.approx(body.frequencies[1], rel=1e-9)
    tip = body.translations[body.tip]
    assert tip[0, 1] == pytest.approx(0.0, abs=1e-9)  # the tip node stands off the axis: x moves as well
    assert tip[0, 0] != 0
    one = flexible_body(imported(path, root=(0, 1, 2, 3), modes=1))
    assert one.translations[..., 0] == pytest.approx(body.translations[..., 0], abs=1e-9)


def test_a_hub_is_added(tmp_path: Path) -> None:
    block = Block()
    path = save(tmp_path / "block.npz", block.nodes, *block.matrices)
    alone = flexible_body(imported(path, root=FACE))
    body = flexible_body(imported(path, root=FACE, mass=2.0, inertia=(0.1, 0.2, 0.3)))
    assert body.mass - alone.mass == pytest.approx(2.0)
    assert body.inertia - alone.inertia == pytest.approx(np.diag([0.1, 0.2, 0.3]))


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    block = Block()
    path = save(tmp_path / "block.npz", block.nodes, *block.matrices)
    link = imported(path, root=FACE)
    before = flexible_body(link)
    assert flexible_body(link) is before
    mass, stiffness = block.matrices
    save(path, block.nodes, mass * 4, stiffness)
    after = flexible_body(link) if path.stat().st_size else before
    assert after.frequencies == pytest.approx(before.frequencies / 2)


def refusal(path: Path, **keys: object) -> str:
    with pytest.raises(InputError) as caught:
        flexible_body(imported(path, **keys))
    message = str(caught.value)
    assert message.startswith(f"link 'link1', modal.file {path}: ")
    return message.removeprefix(f"link 'link1', modal.file {path}: ")


@pytest.fixture
def block_file(tmp_path: Path) -> Path:
    block = Block()
    return save(tmp_path / "block.npz", block.nodes, *block.matrices)


@pytest.mark.parametrize("root", [0, (0, 1), (0, 3, 6)])
def test_nodes_that_do_not_hold_a_body_without_rotations(block_file: Path, root: object) -> None:
    assert "leaves the body free to turn, since its nodes have no rotations; name three" in refusal(
        block_file, root=root
    )


def test_nodes_out_of_range(block_file: Path) -> None:
    assert refusal(block_file, root=99) == "root = 99, but the file has nodes 0 to 62."
    assert refusal(block_file, root=(0, 1, 63)).startswith("root = 63, but")
    assert refusal(block_file, root=FACE, tip=63).startswith("tip = 63, but")


def test_a_free_body_must_begin_at_its_frame(block_file: Path) -> None:
    message = refusal(block_file, boundary="free", root=0)
    assert message.startswith("root is at [0.0, -0.1, -0.05], but a body with free modes has its root at its")


def test_more_modes_than_the_mesh_has(block_file: Path) -> None:
    with pytest.raises(InputError, match="'link1': modes = 200, but the body has only 162 of them"):
        flexible_body(imported(block_file, root=FACE, modes=200))


def test_a_body_that_is_not_free_is_refused(tmp_path: Path) -> None:
    block = Block()
    mass, stiffness = block.matrices
    held = stiffness.tolil()
    held[0, 0] += 1e12
    path = save(tmp_path / "held.npz", block.nodes, mass, held.tocsr())
    assert refusal(path, root=FACE).startswith(
        "stiffness resists a rigid motion of the body; give the matrix"
    )


def test_direction_dependent_masses_are_refused(tmp_path: Path) -> None:
    block = Block()
    mass, stiffness = (matrix.toarray() for matrix in block.matrices)
    order = np.arange(len(mass)).reshape(-1, 3).T.ravel()  # all x, then all y, then all z
    np.savez(
        tmp_path / "m.npz",
        nodes=block.nodes,
        mass=mass[order][:, order],
        stiffness=stiffness[order][:, order],
    )
    assert "must be one and the same mass" in refusal(tmp_path / "m.npz", root=FACE)


def test_a_mechanism_is_refused(tmp_path: Path) -> None:
    """Two blocks that do not touch: the second one floats, though the whole has no other rigid motion."""
    block = Block()
    mass, stiffness = (matrix.toarray() for matrix in block.matrices)
    twice = [np.kron(np.eye(2), matrix) for matrix in (mass, stiffness)]
    nodes = np.concatenate([block.nodes, block.nodes + np.array([2.0, 0, 0])])
    np.savez(tmp_path / "two.npz", nodes=nodes, mass=twice[0], stiffness=twice[1])
    assert refusal(tmp_path / "two.npz", root=FACE).startswith("a part of the body moves without being def")
    assert refusal(tmp_path / "two.npz", root=CENTER, boundary="free").startswith(
        "a part of the body moves with"
    )
