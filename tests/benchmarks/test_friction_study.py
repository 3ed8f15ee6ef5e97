"""The friction study's cases: each part of a law can be switched separately, and the modes suffice."""

from __future__ import annotations

import numpy as np

from benchmarks.friction.cases import LAWS, MU_KINETIC, PRELOAD, Case
from benchmarks.friction.truncation import CONVERGED, SHIPPED, free_frequencies
from reference_model.plant.closed_loop import Plant
from robot_model import load_robot


def test_equal_coefficients_remove_the_static_friction_excess() -> None:
    for law in LAWS[1:]:
        for use in Case(law, preload=PRELOAD, static=MU_KINETIC).robot.effects:
            values = use.model_dump()
            assert values["static_torque"] == values["coulomb_torque"]
            assert values["load_static_coefficient"] == values["load_coefficient"]


def test_a_planar_joint_model_is_loaded_by_the_radial_force_only() -> None:
    loads = {}
    for joint in ("spatial", "planar"):
        plant = Plant(Case("none", joint=joint).robot)
        state = np.linspace(0.1, 0.4, plant.layout.size)
        found = plant.watch(0.0, state, np.zeros(2), np.ones(plant.commands))
        loads[joint] = np.asarray(found[plant.WATCHED.index("loads")]).reshape(2, 4)
    radial, _, bending, total = loads["planar"].T
    assert (bending > 1.0).all()
    assert np.allclose(total, radial, rtol=1e-9)
    assert (loads["spatial"][:, 3] > 2 * total).all()


def test_only_the_modes_of_the_study_give_the_fourth_frequency_within_one_percent() -> None:
    case = Case("none")
    limit = free_frequencies(case.but(elements=CONVERGED[0], modes=CONVERGED[1]).robot)[3]
    assert abs(free_frequencies(case.robot)[3] / limit - 1) < 0.01
    assert abs(free_frequencies(case.but(elements=SHIPPED[0], modes=SHIPPED[1]).robot)[3] / limit - 1) > 0.1


def test_shipped_robots_have_the_modes_stated_on_the_page() -> None:
    for name in ("flexible_space_robot", "flexible_space_robot_planar"):
        beams = [link.beam for link in load_robot(name).links if link.beam]
        assert [(beam.elements, beam.modes) for beam in beams] == [SHIPPED]
