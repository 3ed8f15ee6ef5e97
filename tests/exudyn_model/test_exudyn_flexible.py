"""Flexible links: frequencies by hand, balances, and modal against geometrically exact beams."""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from flexible_robots import beam, free_robot, mast
from scipy.linalg import block_diag

from benchmarks.cross_validation.meshes import mesh_file
from exudyn_model import simulate
from exudyn_model.bodies.beam import _stiffness, beam_nodes, beam_shapes
from exudyn_model.bodies.flexible_link import flexible_link
from exudyn_model.bodies.imported import imported
from exudyn_model.bodies.moments import moments_of
from exudyn_model.bodies.shortening import shortening
from exudyn_model.equations import Posture, equations
from reference_model.simulation import simulate as reference_simulate
from robot_model import EffectUse, InputError, Joint, Link, Recording, Reference, load_robot
from robot_model.description.flexible import ModalBody, TipBody

#: Tolerances of the reference run; its own error is then well below the differences asserted here.
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def test_a_cantilever_with_a_heavy_tip_has_its_frequency() -> None:
    given = beam(tip=TipBody(mass=30.0), elements=20, modes=2)
    stiffness = 3 * given.young * given.section.figures[2] / given.length**3
    expected = sqrt(stiffness / (30.0 + 33 / 140 * given.mass))
    # Rayleigh's 33/140 of a light beam is good to 1e-4 of the frequency.
    np.testing.assert_allclose(beam_shapes(given).frequencies, expected, rtol=1e-3)


def test_a_bare_cantilever_converges_to_its_frequencies() -> None:
    thin = beam(tip=TipBody(), elements=20, modes=4)
    inertia, per_length = thin.section.figures[2], thin.mass / thin.length
    unit = sqrt(thin.young * inertia / per_length) / thin.length**2
    # cos x cosh x = -1; lumped masses are 1 % low at most with 20 elements, rotary inertia less.
    expected = unit * np.array([1.875104, 1.875104, 4.694091, 4.694091]) ** 2
    np.testing.assert_allclose(beam_shapes(thin).frequencies, expected, rtol=1e-2)


def test_modes_are_orthonormal_in_the_lumped_masses() -> None:
    given = beam()
    shapes, nodes = beam_shapes(given), beam_nodes(given)
    matrix = sum(
        node.mass * phi.T @ phi + psi.T @ node.inertia @ psi
        for node, phi, psi in zip(nodes, shapes.translations, shapes.rotations)
    )
    np.testing.assert_allclose(matrix, np.eye(2), atol=1e-10)


def test_a_free_beam_has_no_rigid_mode_among_its_modes() -> None:
    shapes = beam_shapes(beam(boundary="free", elements=8, modes=3))
    assert shapes.frequencies.min() > 2 * pi
    moved = sum(n.mass * phi for n, phi in zip(beam_nodes(beam()), shapes.translations))
    np.testing.assert_allclose(moved, 0.0, atol=1e-8)  # mean axes: the centre of mass stays


def test_a_loaded_mast_swings_about_its_sag() -> None:
    found = simulate(mast(), sensors=False)
    given = beam()
    shapes = beam_shapes(given)
    # Modal series of the step of a uniform field along z: x_k = p_k/w_k^2 (1 - cos w_k t).
    loads = sum(n.mass * phi.T @ [0, 0, -0.02] for n, phi in zip(beam_nodes(given), shapes.translations))
    w = shapes.frequencies
    x = loads / w**2 * (1 - np.cos(np.outer(found.time, w)))
    expected = x @ shapes.translations[-1].T
    # Modes above f1 = 0.9 Hz ring slightly; at 1 ms their phase is off by (w h)^3 / 12 each step.
    size = np.abs(expected[:, 2]).max()
    np.testing.assert_allclose(found["pole.tip_deflection.z"], expected[:, 2], atol=2e-4 * size)
    np.testing.assert_allclose(found["pole.strain.1"], x @ shapes.strain[0], atol=1e-9)
    assert found["robot.energy"] == pytest.approx(found["robot.energy"][0], abs=1e-6)


def test_internal_forces_conserve_the_momentum_of_a_free_robot() -> None:
    found = simulate(free_robot(), sensors=False)
    for axis in "xyz":
        for kind in ("linear", "angular"):
            momentum = found[f"robot.{kind}_momentum.{axis}"]
            # About 1 N s and 3 N m s, kept but for the error of the step, (w h)^2 / 12 of what rings.
            np.testing.assert_allclose(momentum, momentum[0], atol=2e-5)


@pytest.mark.proof
def test_the_difference_decreases_at_second_order() -> None:
    robot = free_robot()
    names = ("elbow.position", "boom.tip_deflection.y", "boom.tip_deflection.z", "shoulder.position")
    runs = [simulate(robot, sensors=False, step=step) for step in (1e-3, 5e-4, 2.5e-4)]
    for name in names:
        coarse, fine = (float(np.abs(run[name] - runs[2][name]).max()) for run in runs[:2])
        # 1 - 1/16 over 1/4 - 1/16 is 5; steps that error control cut make it a little less regular.
        assert fine < coarse / 3


def largest(first: Recording, second: Recording, quantities: tuple[str, ...]) -> float:
    """Largest difference of these quantities, over all places and instants."""
    names = [name for name in first if name.split(".")[1] in quantities]
    assert names
    return max(float(np.abs(first[name] - second[name]).max()) for name in names)


SMOOTH = ("position", "velocity", "attitude", "linear_velocity", "angular_velocity", "tip_deflection")
SHARP = ("radial_force", "axial_force", "bending_moment", "tip_acceleration", "linear_acceleration")


def test_the_engines_agree_on_the_flexible_space_robot() -> None:
    robot = load_robot("flexible_space_robot")
    assert robot.reference is not None
    short = robot.reference.model_copy(update={"duration": 0.5, "sample_rate": 40.0})
    robot = robot.model_copy(update={"reference": short})
    theirs = reference_simulate(robot, sensors=False, **TIGHT)
    coarse, fine = (simulate(robot, sensors=False, step=step) for step in (2e-3, 1e-3))
    assert set(SMOOTH) <= {name.split(".")[1] for name in fine if name in theirs}
    # Both carry the same lumped finite elements and modes: what is left is the step's, at second order.
    for quantities, size in ((SMOOTH, 1e-6), (SHARP, 2e-3)):
        assert largest(fine, theirs, quantities) < size
        assert largest(fine, theirs, quantities) < largest(coarse, theirs, quantities) / 3.5


def test_the_engines_agree_on_a_spherical_joint() -> None:
    robot = free_robot()
    ball = Joint(
        name="elbow",
        kind="spherical",
        parent="upper",
        child="boom",
        origin=(1.0, 0.0, 0.0),
        rpy=(0.2, 0.0, 0.1),
        initial_angular_velocity=(0.1, 0.4, 0.2),
    )
    robot = robot.model_copy(update={"joints": (robot.joints[0], ball), "effects": robot.effects[:1]})
    mine, theirs = simulate(robot, sensors=False), reference_simulate(robot, sensors=False, **TIGHT)
    # Two modes of 10 and 40 Hz struck by a torque at 1 ms: their phase is off by some percent of a percent.
    assert largest(mine, theirs, ("position", "attitude")) < 1e-5
    assert largest(mine, theirs, ("velocity", "angular_velocity")) < 2e-3


@pytest.mark.proof
def test_exact_beams_converge_to_the_modes_with_more_elements() -> None:
    gaps = []
    for elements in (4, 8):
        robot = mast(links=(Link(name="pole", beam=beam(elements=elements, modes=8)),))
        modal = simulate(robot, sensors=False)["pole.tip_deflection.z"]
        exact = simulate(robot, sensors=False, flexible="beam")["pole.tip_deflection.z"]
        gaps.append(float(np.abs(modal - exact).max() / np.abs(modal).max()))
    # Lumped masses against spread ones: of second order in the element's length, 1 % with four.
    assert gaps[0] < 1e-2
    assert gaps[1] < gaps[0] / 3


@pytest.mark.parametrize("kind", ["modal", "beam"])
def test_a_flexible_link_on_a_deforming_one_keeps_momentum(kind: str) -> None:
    robot = free_robot()
    first = Link(name="upper", beam=beam(tip=TipBody(mass=0.5, inertia=(0.01, 0.01, 0.01))))
    outer = robot.joints[1].model_copy(update={"origin": (2.0, 0.0, 0.0)})
    robot = robot.model_copy(
        update={
            "links": (first, robot.links[1]),
            "joints": (robot.joints[0], outer),
            "reference": Reference(duration=0.05, sample_rate=100.0),
        }
    )
    found = simulate(robot, sensors=False, flexible=kind)
    for axis in "xyz":
        momentum = found[f"robot.angular_momentum.{axis}"]
        np.testing.assert_allclose(momentum, momentum[0], atol=1e-6)  # of 10 N m s


def test_a_joint_at_no_node_is_refused() -> None:
    robot = free_robot()
    outer = robot.joints[1].model_copy(update={"origin": (0.9, 0.0, 0.0)})
    links = (Link(name="upper", beam=beam()), robot.links[1])
    beside = robot.model_copy(update={"links": links, "joints": (robot.joints[0], outer)})
    with pytest.raises(InputError, match=r"'upper'.*\[0.9, 0.0, 0.0\], which is no node of it"):
        simulate(beside)


def test_an_imported_beam_equals_the_described_one(tmp_path: Path) -> None:
    given = beam(tip=TipBody(mass=3.0, inertia=(0.02, 0.01, 0.012)), modes=4, gauges=())
    mass = block_diag(*(b for n in beam_nodes(given) for b in (n.mass * np.eye(3), n.inertia)))
    places = [node.position for node in beam_nodes(given)]
    np.savez(tmp_path / "beam.npz", nodes=places, mass=mass, stiffness=_stiffness(given))
    body = ModalBody(file=str(tmp_path / "beam.npz"), modes=4)
    robot = free_robot()
    links = [
        robot.links[1].model_copy(update=kind) for kind in ({"beam": given}, {"beam": None, "modal": body})
    ]
    chance = np.random.default_rng(3)
    x, v = 0.1 * chance.normal(size=(2, 4))
    q, qd = chance.normal(size=(2, 2))
    state = Posture(q, qd, np.eye(3), chance.normal(size=6), modal=x, modal_rates=v)
    one, other = (
        equations(robot.model_copy(update={"links": (robot.links[0], link)}), state) for link in links
    )
    # Rotary inertia by other points, modes by another solution of the eigenproblem: rounding.
    np.testing.assert_allclose(other.mass, one.mass, atol=1e-11 * np.abs(one.mass).max())
    np.testing.assert_allclose(other.forces, one.forces, atol=1e-10 * np.abs(one.forces).max())


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({}, "'pole'.*is no file"),
        ({"tip": 20}, r"tip = 20, but the file has nodes 0 to 19"),
        ({"root": 0}, "leaves the body free to turn"),
        ({"modes": 60}, "modes = 60, but the body has only 48"),
        ({"boundary": "free", "root": 4}, "has its root at its frame's origin"),
    ],
)
def test_an_impossible_imported_body_is_refused(change: dict[str, object], sentence: str) -> None:
    file = mesh_file("lattice") if change else "nowhere.npz"
    given = {"file": file, "modes": 3, "root": (0, 1, 2, 3), **change}
    link = Link.model_validate({"name": "pole", "modal": given})
    with pytest.raises(InputError, match=sentence):
        simulate(mast(links=(link,)))


def test_a_large_mesh_has_the_modes_of_a_small_one() -> None:
    """The lowest modes by iteration, as of meshes with thousands of nodes, against all at once."""
    for boundary in ("clamped", "free"):
        given = ModalBody(file=mesh_file("lattice"), modes=3, root=(0, 1, 2, 3), boundary=boundary)
        small = imported("pole", given)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("exudyn_model.bodies.imported.DENSE", 0)
            large = imported("pole", given)
        np.testing.assert_allclose(large.shapes.frequencies, small.shapes.frequencies, rtol=1e-9)
        np.testing.assert_allclose(large.shapes.translations, small.shapes.translations, atol=1e-6)


def test_a_payload_out_on_a_beam_moves_with_its_node() -> None:
    at = {"mass": 0.7, "x": 1.6, "y": 0.05, "z": -0.04}
    use = EffectUse.model_validate({"effect": "payload", "at": "boom", **at})
    robot = free_robot(gravity=(0.1, -0.2, -0.3)).with_effects(use)
    theirs = reference_simulate(robot, sensors=False, **TIGHT)
    coarse, fine = (simulate(robot, sensors=False, step=h, integrator="trapezoidal") for h in (1e-3, 5e-4))
    for quantities in (("position", "attitude"), ("tip_deflection",), ("modal_coordinate",)):
        # Second order, so a fourth; the two formulas of the payload are the same to rounding.
        assert largest(fine, theirs, quantities) < largest(coarse, theirs, quantities) / 3.5
    without = reference_simulate(robot.model_copy(update={"effects": robot.effects[:-1]}), sensors=False)
    # The payload moves the robot by far more than the engines differ.
    assert largest(without, theirs, ("position",)) > 100 * largest(fine, theirs, ("position",))


def test_a_payload_on_modes_agrees_with_one_on_an_exact_beam() -> None:
    use = EffectUse.model_validate({"effect": "payload", "at": "pole", "mass": 0.5, "x": 1.5, "y": 0.03})
    robot = mast(links=(Link(name="pole", beam=beam(elements=8, modes=8)),)).with_effects(use)
    modal, exact = (simulate(robot, sensors=False, flexible=kind) for kind in ("modal", "beam"))
    peak = np.abs(modal["pole.tip_deflection.z"]).max()
    # Lumped masses against spread ones: of second order in the elements' length, below 1 % with eight.
    np.testing.assert_allclose(
        modal["pole.tip_deflection.z"], exact["pole.tip_deflection.z"], atol=1e-2 * peak
    )


def test_bending_shortens_a_cantilever_by_the_closed_form() -> None:
    given = beam(tip=TipBody(mass=30.0), elements=40, modes=2)
    shapes = beam_shapes(given)
    x = np.zeros(2)
    x[0] = 1.0
    across = float(np.linalg.norm(shapes.translations[-1] @ x))
    # A light cantilever with a force at its tip, w = a (3 s^2 - s^3) / 2: the integral of w'^2 is 6/5 a^2/L.
    # The beam's own mass bends the mode by some per cent of a per cent.
    assert x @ shortening(given, shapes)[-1] @ x == pytest.approx(1.2 * across**2 / given.length, rel=1e-3)


def test_a_spinning_modal_blade_stiffens_by_southwells_slope() -> None:
    """Out of the plane a bare blade's first frequency rises by 1.193 of the squared rate (Southwell 1921)."""
    spin, given = 12.0, beam(tip=TipBody(), elements=12, modes=8, gauges=(), stiffening=True)
    link = flexible_link(Link(name="blade", beam=given))
    assert link.surplus is not None
    points, omega = moments_of(link.points), np.array([0.0, 0.0, spin])
    x = np.zeros(8)

    def pull(own: np.ndarray) -> np.ndarray:
        bent = np.concatenate([[1.0], own])
        swept = np.einsum("jqaa,q,a->j", points.second[1:, :], bent, np.array([1.0, 1.0, 0.0])) * spin**2
        assert link.surplus is not None
        return swept + link.surplus.force(omega, own, x)[6:]

    stiffness = np.diag(link.shapes.frequencies**2)
    stiffness -= np.column_stack([pull(unit) - pull(x) for unit in np.eye(8)])
    across = np.abs(link.shapes.translations[-1][2]) > 1e-6  # those out of the plane
    lowest = np.linalg.eigvalsh(stiffness[np.ix_(across, across)])[0]
    before = link.shapes.frequencies[across][0] ** 2
    # Four modes and twelve elements: a per cent.
    assert (lowest - before) / spin**2 == pytest.approx(1.193, rel=0.01)
