"""Laws that fit only with a number that they cannot have stand in for another force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import AXIS, bare, plain_view, problem_of, recorded, term
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.preparation.proof import HeldOut
from missing_physics.diagnosis.unnamed.adequacy import adequate, left_by
from missing_physics.diagnosis.unnamed.bounds import wants_beyond

Array = NDArray[np.float64]
Force = Callable[[Array], Array]

#: A ripple is looked for with three quarters of a cycle within the travel at least, which is 0.2 m here.
LONGEST = 0.75 * 2 * np.pi / 0.2


def cubic(q: Array) -> Array:
    return 6e4 * (q - 0.22) ** 3


def ripple(q: Array) -> Array:
    return 300.0 * (q - 0.2) + 12.0 * np.cos(1.3 * LONGEST * q)


def made(force: Force, seed: int) -> Problem:
    robot = bare("single_axis", noise=True)
    return problem_of(robot, recorded(robot, AXIS, lambda t, q, qd, qdd: force(q), duration=24.0, seed=seed))


def named(problem: Problem) -> Explanation:
    """A spring and a ripple."""
    ordered = replace(
        term("torque_ripple", "joint1", cosine=1.0, sine=1.0, order=1.2 * LONGEST),
        narrowed={"order": (LONGEST, 1e5)},
        unseen=("cosine_per_torque", "sine_per_torque"),
    )
    scale = problem.noise_floor
    return explain(
        problem, plain_view(problem, scale=scale), [term("cable_spring", "joint1", stiffness=0.0), ordered]
    )


@pytest.mark.parametrize(("force", "beyond"), [(cubic, True), (ripple, False)])
def test_only_a_ripple_that_stands_for_a_bend_wants_to_be_longer_than_the_travel(
    force: Force, *, beyond: bool
) -> None:
    found = named(made(force, seed=13037))
    spring, wave = found.found
    assert bool(wants_beyond(found, wave)) == beyond
    assert wants_beyond(found, spring) == ""


def test_a_cubic_spring_is_not_called_a_spring_with_a_long_ripple() -> None:
    """Both together leave a thousandth of its energy; one of them would have to be what it cannot be."""
    problem, later = made(cubic, seed=13037), made(cubic, seed=13165)
    found = named(problem)
    held_out = HeldOut(later, later.sliding.any(axis=1), found.view.scale)
    nothing = explain(problem, found.view, [], nuisance=False)
    before = left_by(nothing, held_out)
    assert left_by(found, held_out)[0] < 1e-2 * before[0]
    best, _, dropped = adequate(found, held_out, before=before, nuisance=True)
    assert best.found == ()
    assert [term.effect.id for term, _ in dropped] == ["torque_ripple", "cable_spring"]
    assert "order has to be beyond" in dropped[0][1]


def test_a_number_at_its_end_by_chance_is_where_it_may_be() -> None:
    """A ripple of the longest period itself: noise moves its order to either side of the end."""

    def longest(q: Array) -> Array:
        return 300.0 * (q - 0.2) + 12.0 * np.cos(LONGEST * (q - 0.2))

    orders = []
    for seed in range(3):
        found = named(made(longest, seed=seed))
        assert wants_beyond(found, found.found[1]) == ""
        orders.append(found.found[1].parameters["order"])
    assert min(orders) == LONGEST  # it was there
