"""Trajectories of both engines: they converge with Exudyn's step, and are close at ordinary steps."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.cross_validation.convergence import STUDIES, Study, course
from benchmarks.cross_validation.deflection import by_elements, by_load
from benchmarks.cross_validation.matrix import (
    Case,
    build_cases,
    cases,
    controller_cases,
    effect_cases,
    outcome,
)

pytestmark = pytest.mark.cross_validation

BY_NAME = {study.name: study for study in STUDIES}
#: Corners of the matrix that together cover every robot, law and motion; the complete matrix and its three
#: longest corners are long tests.
CORNERS = (
    ("rigid", "planar", "fixed", "Stribeck", "slow"),
    ("rigid", "spatial", "free", "LuGre with load", "reversing"),
    ("flexible", "planar", "free", "LuGre", "fast"),
    ("flexible", "spatial", "fixed", "Coulomb", "reversing"),
)


def named(case: Case) -> str:
    return ", ".join(case.labels)


def test_rigid_trees_converge_at_sixth_order_to_rounding() -> None:
    found = course(BY_NAME["rigid, tree, Runge-Kutta"])
    assert found.holds
    # From the second halving on the tolerance of the reference run, 1e-13, is what is left.
    assert found.orders("position")[0] == pytest.approx(6, abs=1)


@pytest.mark.parametrize(
    "name",
    [
        "rigid, constraints, trapezoidal",
        "flexible, constraints, trapezoidal",
        "flexible on flexible, constraints, trapezoidal",
    ],
)
def test_constrained_systems_converge_at_second_order(name: str) -> None:
    found = course(replace(BY_NAME[name], steps=(1e-3, 5e-4)))
    for quantity in found.relative:
        # The next term of the expansion is of relative size (w h)^2, of the modes a few percent.
        assert found.order(quantity) == pytest.approx(2, abs=0.1), quantity


@pytest.mark.proof
def test_constraint_forces_carry_no_rounding_divided_by_the_step() -> None:
    found = course(replace(BY_NAME["rigid, constraints, trapezoidal"], steps=(1.5625e-5,)))
    # 6e-9, and 1.4e-8 with lengths rounded off at 1e-9 N; 4.7e-8 with the multipliers of Newton's iterations
    assert found.relative["constraint force"][0] < 1e-8


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(c, id=named(c), marks=pytest.mark.proof if c.labels in CORNERS[1:] else ())
        for c in cases()
        if c.labels in CORNERS
    ],
)
def test_corners_of_the_matrix(case: Case) -> None:
    found = outcome(case)
    assert found.holds, found


@pytest.mark.proof
@pytest.mark.parametrize("case", [*cases(), *build_cases(), *controller_cases(), *effect_cases()], ids=named)
def test_the_complete_matrix(case: Case) -> None:
    found = outcome(case)
    assert found.holds, found


@pytest.mark.proof
@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_every_study_reaches_its_goal(study: Study) -> None:
    found = course(study)
    assert found.holds, found


@pytest.mark.proof
def test_modes_deviate_from_exact_beams_with_deflection() -> None:
    coarse, fine = by_elements()[0], by_elements()[-1]
    assert fine.across < coarse.across / 8  # of second order in the elements' length: 16
    gaps = by_load()
    assert gaps[1].across < 1e-3  # at 1 % deflection
    assert gaps[-1].across > 0.03  # at 30 %
