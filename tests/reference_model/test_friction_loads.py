"""Loads of one and of two bearings, and the resulting friction moment W."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_robots import random_robot

from reference_model.dynamics.balance import LOADS, bearing_load
from reference_model.evaluation.model import RobotModel
from reference_model.simulation import simulate
from robot_model import Bearing, Robot

SPAN = 0.15
PAIR = Bearing(radial_arm=0.05, axial_arm=0.04, span=SPAN)
numbers = st.lists(st.floats(-1e3, 1e3), min_size=6, max_size=6)


def load(wrench: np.ndarray, bearing: Bearing, axis: np.ndarray, kind: str = "revolute") -> dict[str, float]:
    found = bearing_load(kind, ca.SX(axis), ca.SX(wrench), bearing)
    return dict(zip(LOADS, ca.evalf(found).full().ravel()))


def unit(seed: int) -> np.ndarray:
    axis = np.random.default_rng(seed).normal(size=3)
    return axis / np.linalg.norm(axis)


@settings(max_examples=50)
@given(numbers, st.integers(0, 1000))
def test_two_bearings_balance_force_and_moment(numbers: list[float], seed: int) -> None:
    """The forces at +-b/2 on the axis whose sum and moment are those of the joint."""
    axis, force, moment = unit(seed), np.array(numbers[:3]), np.array(numbers[3:])
    across = np.eye(3) - np.outer(axis, axis)
    # [R1; R2] across the axis: R1 + R2 = F_r and (b/2) H x (R1 - R2) = N_b, by least squares.
    turn = SPAN / 2 * np.cross(axis, np.eye(3)).T
    balance = np.block([[np.eye(3), np.eye(3)], [turn, -turn], [axis, 0 * axis], [0 * axis, axis]])
    need = np.concatenate([across @ force, across @ moment, [0.0, 0.0]])
    reactions = np.linalg.lstsq(balance, need, rcond=None)[0].reshape(2, 3)
    assert np.allclose(balance @ reactions.ravel(), need, atol=1e-8)
    expected = np.linalg.norm(reactions, axis=1).sum()
    # Rounding of numbers up to 1e3 / 0.15.
    wrench = np.array(numbers)
    assert load(wrench, PAIR, axis)["radial_sum"] == pytest.approx(expected, rel=1e-10, abs=1e-10)


def test_loads_of_two_bearings_in_simple_cases() -> None:
    axis = np.array([0.0, 0.0, 1.0])
    # Force alone is shared and adds up to itself; a couple alone is N/b at each bearing.
    assert load(np.array([3.0, 4, 9, 0, 0, 0]), PAIR, axis)["radial_sum"] == pytest.approx(5.0, abs=1e-8)
    couple = load(np.array([0, 0, 0, 6.0, 8, 7]), PAIR, axis)
    assert couple["radial_sum"] == pytest.approx(2 * 10 / SPAN, rel=1e-9)
    assert couple["bending_moment"] == pytest.approx(10.0)
    # Force and couple in one plane: R_1,2 = |F/2 +- N/b|, so the force is hidden while N > F b/2.
    both = load(np.array([5.0, 0, 0, 0, 10, 0]), PAIR, axis)
    assert both["radial_sum"] == pytest.approx(2 * 10 / SPAN, rel=1e-9)
    # Across each other: 2 sqrt((F/2)^2 + (N/b)^2).
    both = load(np.array([5.0, 0, 0, 10, 0, 0]), PAIR, axis)
    assert both["radial_sum"] == pytest.approx(2 * np.hypot(2.5, 10 / SPAN), rel=1e-9)


@settings(max_examples=50)
@given(numbers, st.integers(0, 1000))
def test_two_bearing_loads_never_exceed_the_scalar_sum(numbers: list[float], seed: int) -> None:
    single = PAIR.model_copy(update={"span": None, "bending_arm": SPAN / 2})
    wrench, axis = np.array(numbers), unit(seed)
    pair, scalar = load(wrench, PAIR, axis), load(wrench, single, axis)
    larger = max(scalar["radial_force"], 2 * scalar["bending_moment"] / SPAN)
    assert larger - 1e-6 <= pair["radial_sum"] <= scalar["radial_sum"] + 1e-6  # rounding of up to 1e4 N


def test_axial_moment_of_a_guide_enters_through_the_bending_arm() -> None:
    axis = np.array([1.0, 0.0, 0.0])
    bearing = Bearing(radial_arm=1.0, span=SPAN, bending_arm=0.02)
    found = load(np.array([50.0, 3, 4, 2, 0, 0]), bearing, axis, kind="prismatic")
    assert found["axial_force"] == 0
    assert found["radial_sum"] == pytest.approx(5.0 + 2.0 / 0.02, rel=1e-8)


@pytest.mark.parametrize("bearing", [PAIR, Bearing(radial_arm=0.05, axial_arm=0.04, bending_arm=0.1)])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_loads_have_a_derivative_where_they_vanish(bearing: Bearing, kind: str) -> None:
    wrench = ca.SX.sym("w", 6)
    loads = bearing_load(kind, ca.SX([0.0, 0.6, 0.8]), wrench, bearing)
    function = ca.Function("slope", [wrench], [loads, ca.jacobian(loads, wrench)])
    value, slope = (np.asarray(part) for part in function(np.zeros(6)))
    np.testing.assert_array_equal(value, 0.0)
    np.testing.assert_array_equal(slope, 0.0)  # rounded off: even in every load


def test_simulated_friction_is_the_coefficient_times_the_load_of_both_bearings() -> None:
    data = random_robot(4, base="fixed", kinds=["revolute", "revolute"]).model_dump()
    for joint in data["joints"]:
        joint["bearing"] = PAIR.model_dump()
        joint["initial_velocity"] = 4.0
    data["reference"] = {"duration": 0.4, "sample_rate": 500.0}
    data["effects"] = [
        {"effect": "load_dependent_friction", "at": "joint1", "coefficient": 0.1, "gear_share": 0.0}
    ]
    robot = Robot.model_validate(data)
    recording = simulate(robot, sensors=False)
    names = [joint.name for joint in robot.moving_joints]
    motion = [
        np.stack([recording[f"{name}.{key}"] for name in names], axis=1)
        for key in ("position", "velocity", "acceleration")
    ]
    forces, moments = (part[:, names.index("joint1")] for part in RobotModel(robot).joint_wrenches(*motion))
    axis = robot.joint("joint1").unit_axis
    couple = np.cross(axis, moments) / SPAN
    half = (forces - np.outer(forces @ axis, axis)) / 2
    radial = np.linalg.norm(half + couple, axis=1) + np.linalg.norm(half - couple, axis=1)
    moment = PAIR.axial_arm * np.abs(forces @ axis) + PAIR.radial_arm * radial
    wanted = -0.1 * moment * np.tanh(recording["joint1.velocity"] / 1e-4)
    assert np.ptp(moment) > 0.1
    np.testing.assert_allclose(recording["joint1.friction_torque"], wanted, atol=1e-8)  # rounding, floor
