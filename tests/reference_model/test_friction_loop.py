"""The loop of bearing loads and friction: its convergence, and the error if it does not converge."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from random_robots import random_robot

from reference_model.plant import loop
from reference_model.plant.closed_loop import Plant
from reference_model.plant.loop import Affine, fixed_point
from reference_model.simulation import simulate
from robot_model import InputError, Robot

RESIDUAL = Plant.WATCHED.index("residual")


def loaded(kinds: list[str], coefficient: float, *, base: str = "fixed", joints: int | None = None) -> Robot:
    """A random robot; its first `joints` joints have friction in proportion to two bearings' load."""
    data = random_robot(3, base=base, kinds=kinds).model_dump()
    for joint in data["joints"]:
        joint["bearing"] = {"radial_arm": 0.05, "axial_arm": 0.04, "span": 0.15}
    data["effects"] = [
        {
            "effect": "load_dependent_friction",
            "at": joint["name"],
            "coefficient": coefficient,
            "gear_share": 0.0,
        }
        for joint in data["joints"][:joints]
    ]
    data["reference"] = {"duration": 0.2, "sample_rate": 200.0}
    return Robot.model_validate(data)


def residuals(robot: Robot, states: int = 30, violence: float = 5.0) -> np.ndarray:
    """What is left in the loop at random states, speeds of some rad/s and torques of 100 N m."""
    plant, rng = Plant(robot), np.random.default_rng(1)
    n = plant.layout.joints
    found = []
    for _ in range(states):
        state = violence * rng.normal(size=plant.layout.size)
        torque = 100 * rng.normal(size=n)
        found.append(float(plant.watch(0.0, state, np.zeros(n), torque)[RESIDUAL]))
    return np.array(found)


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_newton_passes_converge_at_extreme_states(base: str) -> None:
    # Coefficients of dry steel; the loop is asked for 1e-10 and left with rounding.
    assert residuals(loaded(["revolute"] * 4, 0.5, base=base)).max() < 1e-13


def test_every_pass_squares_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    largest = []
    for passes in (1, 2, 3):
        monkeypatch.setattr(loop, "NEWTON_PASSES", passes)
        largest.append(np.median(residuals(loaded(["revolute"] * 3, 0.5))))
    orders = np.log(largest[1:]) / np.log(largest[:-1])
    # Logarithms of errors double with each pass; a half is left for the constant in front.
    assert largest[0] < 0.5
    assert np.all(orders > 1.5)


def test_a_loop_with_known_contraction() -> None:
    """x = a - m |x - b|: friction that carries a load which it changes itself; solved by hand."""
    m, a, b = 0.4, 3.0, 1.0
    seen = Affine(ca.SX([-b]), ca.SX([[1.0]]))
    found = fixed_point(lambda load: a - m * ca.sqrt(load**2), seen)
    assert float(ca.evalf(found)) == pytest.approx((a + m * b) / (1 + m), rel=1e-14)


def test_only_implicit_forces_are_solved_for() -> None:
    many = Plant(loaded(["revolute"] * 4, 0.3)).rate.n_instructions()
    one = Plant(loaded(["revolute"] * 4, 0.3, joints=1)).rate.n_instructions()
    none = Plant(loaded(["revolute"] * 4, 0.3, joints=0)).rate.n_instructions()
    assert none < one < (none + many) / 2


def test_explicit_forces_enter_the_loop_of_implicit_ones() -> None:
    seen = Affine(ca.SX([1.0, 2.0]), ca.SX([[0.3, 0.1], [0.2, 0.5]]))
    found = ca.evalf(fixed_point(lambda y: ca.vertcat(7.0, ca.sin(y[0] + y[1])), seen)).full().ravel()
    x = found[1]
    assert found[0] == 7.0
    assert x == pytest.approx(np.sin(1 + 0.3 * 7 + 0.1 * x + 2 + 0.2 * 7 + 0.5 * x), abs=1e-12)


def test_the_residual_is_reported() -> None:
    recording = simulate(loaded(["revolute"] * 2, 0.3), sensors=False)
    assert recording["robot.loop_residual"].max() < 1e-12
    free = simulate(loaded(["revolute"] * 2, 0.3, joints=0), sensors=False)
    assert "robot.loop_residual" not in free.channels


def test_a_diverging_loop_is_refused() -> None:
    robot = loaded(["revolute"] * 2, 1.0)
    data = robot.model_dump()
    for joint in data["joints"]:  # arms of two metres, so that friction exceeds what causes it
        joint["bearing"] |= {"radial_arm": 2.0, "axial_arm": 2.0}
        joint["initial_velocity"] = 3.0
    with pytest.raises(InputError, match=r"do not settle at t = .* lower the coefficient"):
        simulate(Robot.model_validate(data))
