"""Exudyn's own mass matrix and forces, projected on the robot's coordinates: by hand, and of both forms."""

from __future__ import annotations

import numpy as np
import pytest
from exudyn_robots import GRAVITY, pendulum, tumbling_robot
from flexible_robots import free_robot

from exudyn_model.bodies.rotation import from_rpy, rotation_by, to_rpy
from exudyn_model.equations import Posture, equations
from robot_model import InputError

#: Rounding of a few hundred additions and of one inverse.
ROUNDING = 1e-13


def posture(seed: int, joints: int) -> Posture:
    chance = np.random.default_rng(seed)
    position, velocity = chance.normal(size=(2, joints))
    turn = rotation_by(chance.normal(size=3))
    return Posture(position, velocity, base_rotation=turn, base_velocity=chance.normal(size=6))


def test_a_pendulum_by_hand() -> None:
    state = Posture(np.array([0.7]), np.array([1.3]))
    for form in ("tree", "redundant"):
        found = equations(pendulum(), state, formulation=form)
        np.testing.assert_allclose(found.mass, [[0.1 + 2.0 * 0.25]], rtol=ROUNDING)
        np.testing.assert_allclose(found.forces, [-2.0 * 9.81 * 0.5 * np.sin(0.7)], rtol=ROUNDING)
    load = found.loads(np.array([0.4]))["hinge"]
    acceleration = found.accelerations(np.array([0.4]))[0]
    along = 2.0 * (0.5 * 1.3**2 + 9.81 * np.cos(0.7))
    across = 2.0 * (0.5 * acceleration + 9.81 * np.sin(0.7))
    assert load.sizes[0] == pytest.approx(np.hypot(along, across), rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_tree_and_constraints_have_the_same_equations(seed: int) -> None:
    robot = tumbling_robot(gravity=GRAVITY)
    state = posture(seed, 3)
    tree, bodies = (equations(robot, state, formulation=form) for form in ("tree", "redundant"))
    for mine, theirs in ((bodies.mass, tree.mass), (bodies.forces, tree.forces)):
        np.testing.assert_allclose(mine, theirs, atol=ROUNDING * np.abs(theirs).max())


def test_the_tree_has_no_flexible_links() -> None:
    with pytest.raises(InputError, match="one-coordinate joints only"):
        equations(free_robot(), posture(0, 2), formulation="tree")


def test_rpy_round_trips() -> None:
    rpy = (0.3, -1.1, 2.9)
    np.testing.assert_allclose(to_rpy(from_rpy(rpy)), rpy, rtol=1e-14)
