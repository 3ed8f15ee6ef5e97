"""Figures of a URDF by hand: defaults, orientations, frames that are kept to the digit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_model import read_robot
from robot_model.formats.poses import from_rpy, rpy_of


def test_an_axis_that_is_not_given_is_x(files: Path, tmp_path: Path) -> None:
    text = (files / "pendulum.urdf").read_text().replace('<axis xyz="0 1 0"/>', "")
    (tmp_path / "arm.urdf").write_text(text)
    assert read_robot(tmp_path / "arm.urdf")[0].joint("pivot").axis == (1.0, 0.0, 0.0)


def test_an_orientation_by_quaternion(files: Path, tmp_path: Path) -> None:
    """Of the format's version 1.1; 90 deg about z, the scalar last."""
    half = np.sqrt(0.5)
    origin = f'<origin xyz="1 2 3" quat_xyzw="0 0 {half} {half}"/><parent link="stand"/>'
    text = (files / "pendulum.urdf").read_text().replace('<parent link="stand"/>', origin)
    (tmp_path / "arm.urdf").write_text(text)
    joint = read_robot(tmp_path / "arm.urdf")[0].joint("pivot")
    assert joint.rpy == pytest.approx((0, 0, np.pi / 2))
    assert joint.origin == (1.0, 2.0, 3.0)


def test_a_frame_that_nothing_turns_keeps_the_digits_of_the_file(files: Path, tmp_path: Path) -> None:
    origin = '<origin xyz="0.1 0 0" rpy="3.1416 1.5708 -0.3"/><parent link="stand"/>'
    text = (files / "pendulum.urdf").read_text().replace('<parent link="stand"/>', origin)
    (tmp_path / "arm.urdf").write_text(text)
    assert read_robot(tmp_path / "arm.urdf")[0].joint("pivot").rpy == (3.1416, 1.5708, -0.3)


@pytest.mark.parametrize("pitch", [0.0, 0.7, np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, 1.0 - np.pi / 2, 3.0])
@pytest.mark.parametrize("roll", [0.0, 2.0, -3.0])
@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_angles_of_a_rotation_are_exact_at_every_pitch(roll: float, pitch: float, yaw: float) -> None:
    rotation = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    np.testing.assert_allclose(from_rpy((roll, pitch, yaw)), rotation, atol=1e-15)
    np.testing.assert_allclose(from_rpy(rpy_of(rotation)), rotation, atol=1e-15)  # rounding of a few products
