"""The drawn robot: closed forms of the arm, rigidity, and boxes with the right inertia."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from missing_physics.reporting.scene.skeleton import body_shapes, poses, reach
from robot_model import Robot, load_robot, robot_from_toml, shipped_robots

#: Products of a few rotation matrices in double precision.
ROUNDING = 1e-12


def test_two_link_arm_against_its_closed_form() -> None:
    robot = load_robot("two_link_arm")
    q1, q2 = np.linspace(-2, 2, 50), np.linspace(1, -3, 50)
    found = poses(robot, {"joint1": q1, "joint2": q2})
    # Both axes are -y, so that a positive angle lifts x towards z; link 1 is 0.5 m long.
    elbow = 0.5 * np.column_stack([np.cos(q1), np.zeros(50), np.sin(q1)])
    assert np.allclose(found["link2"].translation, elbow, atol=ROUNDING)
    along = np.column_stack([np.cos(q1 + q2), np.zeros(50), np.sin(q1 + q2)])
    assert np.allclose(found["link2"].rotation[:, :, 0], along, atol=ROUNDING)


def test_prismatic_joint_moves_along_its_axis() -> None:
    robot = load_robot("single_axis")
    joint = robot.moving_joints[0]
    assert joint.kind == "prismatic"
    values = np.linspace(-0.2, 0.3, 7)
    found = poses(robot, {joint.name: values})[joint.child].translation
    assert np.allclose(found - found[0], np.outer(values - values[0], joint.unit_axis), atol=ROUNDING)


def test_fixed_joint_and_roll_pitch_yaw_follow_urdf() -> None:
    robot = robot_from_toml(
        """
        name = "bracket"
        links = [{name = "arm", mass = 1.0}, {name = "t", mass = 1.0}]
        joints = [
        {name = "q", parent = "base", child = "arm"},
        {name = "f", kind = "fixed", parent = "arm", child = "t", origin = [1, 0, 0], rpy = [0.1, 0.2, 0.3]},
        ]
        """
    )
    found = poses(robot, {"q": np.array([np.pi / 2])})["t"]
    roll, pitch, yaw = (_about(axis, angle) for axis, angle in zip(np.eye(3), (0.1, 0.2, 0.3)))
    assert np.allclose(found.translation, [[0.0, 1.0, 0.0]], atol=ROUNDING)
    expected = _about(np.array([0.0, 0.0, 1.0]), np.pi / 2) @ yaw @ pitch @ roll
    assert np.allclose(found.rotation[0], expected, atol=ROUNDING)


@given(seed=st.integers(0, 10_000))
def test_rotation_matrices_are_orthogonal_and_agree_with_quaternions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for robot in _robots():
        found = poses(robot, {joint.name: rng.uniform(-3, 3, 4) for joint in robot.moving_joints})
        for pose in found.values():
            identity = np.einsum("nij,nik->njk", pose.rotation, pose.rotation)
            assert np.allclose(identity, np.eye(3), atol=ROUNDING)
            x, y, z, w = pose.quaternion.T
            first = np.column_stack([1 - 2 * (y**2 + z**2), 2 * (x * y + z * w), 2 * (x * z - y * w)])
            assert np.allclose(first, pose.rotation[:, :, 0], atol=ROUNDING)


def test_unnamed_joints_stay_at_their_initial_position() -> None:
    robot = load_robot("two_link_arm")
    start = {joint.name: np.array([joint.initial_position]) for joint in robot.moving_joints}
    assert np.array_equal(poses(robot, {})["link2"].translation, poses(robot, start)["link2"].translation)


def test_box_has_the_inertia_of_the_link() -> None:
    a, b, c, mass = 0.4, 0.1, 0.06, 7.0
    inertia = [mass / 3 * s for s in (b * b + c * c, a * a + c * c, a * a + b * b)]
    robot = robot_from_toml(
        f"""
        name = "brick"
        links = [{{name = "brick", mass = {mass}, center_of_mass = [0.4, 0.0, 0.0], inertia = {inertia}}}]
        joints = [{{name = "turn", parent = "base", child = "brick"}}]
        """
    )
    shape = body_shapes(robot)["brick"]
    # Square root of a difference of moments: half the digits of double precision are left at worst.
    assert np.allclose(sorted(shape.half_size), sorted([a, b, c]), rtol=1e-7)
    assert np.array_equal(shape.centre, [0.4, 0.0, 0.0])


def test_every_shipped_robot_can_be_drawn() -> None:
    for robot in _robots():
        size = reach(robot)
        assert size >= 0.1
        for shape in body_shapes(robot).values():
            assert np.all(shape.half_size > 0)
            assert np.all(shape.half_size <= size)
            assert np.linalg.norm(shape.quaternion) == pytest.approx(1.0, abs=ROUNDING)


def _robots() -> list[Robot]:
    return [load_robot(name) for name in shipped_robots()]


def _about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
