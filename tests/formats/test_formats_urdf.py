"""Figures of a URDF by hand: defaults, orientations, frames that are kept to the digit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_model import read_robot
from robot_model.formats.parts.poses import from_rpy, rpy_of


def test_the_default_axis_is_x(files: Path, tmp_path: Path) -> None:
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


def test_an_unrotated_frame_keeps_the_digits_of_the_file(files: Path, tmp_path: Path) -> None:
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


@pytest.mark.parametrize(
    ("kind", "matrix"),
    [
        # x_1 = (m_1 + m_2) / (2 n_1), x_2 = (m_1 - m_2) / (2 n_2), n = 2 and 4; the second motor turns back
        ("Differential", [[0.25, -0.25], [0.125, 0.125]]),
        # x_1 = m_1 / n_1, x_2 = (m_2 - m_1 / n_1) / n_2
        ("FourBarLinkage", [[0.5, 0.0], [-0.125, -0.25]]),
    ],
)
def test_transmissions_of_ros_control_that_couple_joints(
    files: Path, tmp_path: Path, kind: str, matrix: list[list[float]]
) -> None:
    parts = "".join(
        f'<{what} name="{name}"><role>{what}{k}</role>'
        f"<mechanicalReduction>{ratio}</mechanicalReduction></{what}>"
        for what, k, name, ratio in (
            ("actuator", 2, "right", -50),
            ("actuator", 1, "left", 100),
            ("joint", 1, "pivot", 2),
            ("joint", 2, "other", 4),
        )
    )
    added = (
        f'<transmission name="t"><type>transmission_interface/{kind}Transmission</type>{parts}</transmission>'
        '<link name="x"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
        '<joint name="other" type="continuous"><parent link="rod"/><child link="x"/></joint></robot>'
    )
    path = tmp_path / "arm.urdf"
    path.write_text((files / "pendulum.urdf").read_text().replace("</robot>", added))
    robot, notes = read_robot(path)
    (one,) = robot.transmissions
    assert one.joints == ("pivot", "other")
    assert [(motor.name, motor.gear_ratio) for motor in one.motors] == [("left", 100.0), ("right", 50.0)]
    np.testing.assert_allclose(one.joints_from_motors, matrix, atol=1e-15)
    assert any("transmission 't': its actuators become motors" in note for note in notes)
