"""Flexible links: frequencies by hand, balances, and modal against geometrically exact beams."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from flexible_robots import beam, free_robot, mast

from exudyn_model import simulate
from exudyn_model.beam import beam_nodes, beam_shapes
from robot_model import Beam, InputError, Link
from robot_model.flexible import TipBody


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


def test_nothing_inside_a_free_robot_changes_its_momentum() -> None:
    found = simulate(free_robot(), sensors=False)
    for axis in "xyz":
        for kind in ("linear", "angular"):
            momentum = found[f"robot.{kind}_momentum.{axis}"]
            # About 1 N s and 3 N m s, kept but for the error of the step, (w h)^2 / 12 of what rings.
            np.testing.assert_allclose(momentum, momentum[0], atol=2e-5)


def test_its_difference_falls_at_second_order() -> None:
    robot = free_robot()
    names = ("elbow.position", "boom.tip_deflection.y", "boom.tip_deflection.z", "shoulder.position")
    runs = [simulate(robot, sensors=False, step=step) for step in (1e-3, 5e-4, 2.5e-4)]
    for name in names:
        coarse, fine = (float(np.abs(run[name] - runs[2][name]).max()) for run in runs[:2])
        # 1 - 1/16 over 1/4 - 1/16 is 5; steps that error control cut make it a little less regular.
        assert fine < coarse / 3


def test_an_imported_body_is_refused() -> None:
    robot = mast()
    link = Link.model_validate({"name": "pole", "modal": {"file": "nowhere.npz", "modes": 3}})
    with pytest.raises(InputError, match="carries beams only"):
        simulate(robot.model_copy(update={"links": (link,)}))


def test_stiffening_is_refused_in_the_modal_form() -> None:
    stiff = Beam.model_validate({**beam().model_dump(), "stiffening": True})
    robot = mast(links=(Link(name="pole", beam=stiff),))
    with pytest.raises(InputError, match="no geometric stiffening"):
        simulate(robot)
