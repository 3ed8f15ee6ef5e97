"""Robots of URDF and MJCF files have the dynamics that an independent recursion reads from the same file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from newton_euler import Segment, inverse_dynamics, mjcf_segments, urdf_segments
from states import ROUNDING, random_states, read_quietly

from robot_model import Robot, robot_from_toml, robot_to_toml

REAL = (
    "dfki_double_pendulum/design_A.0_cad_double_pendulum.urdf",
    "dfki_simple_pendulum/pendulum.urdf",
    "kuka_iiwa14/iiwa14.urdf",
    "kuka_iiwa14/iiwa14_full_estimated_params.urdf",
)


def check(robot: Robot, segments: list[Segment], names: dict[str, str] | None = None) -> None:
    """Compare forces; `names` leads from the robot's names to the file's. Rotor inertia is added here."""
    states = random_states(robot)
    named = [(names or {}).get(name, name) for name in states.joints]
    assert sorted(named) == sorted(s.joint for s in segments if s.joint)
    rotors = [j.actuator.rotor_inertia * j.actuator.gear_ratio**2 for j in robot.moving_joints if j.actuator]
    for k, force in enumerate(states.force):
        motion = [
            dict(zip(named, table[k])) for table in (states.position, states.velocity, states.acceleration)
        ]
        wanted = inverse_dynamics(segments, *motion, gravity=np.array(robot.gravity))
        wanted = [wanted[name] + rotor * motion[2][name] for name, rotor in zip(named, rotors)]
        np.testing.assert_allclose(force, wanted, rtol=0, atol=ROUNDING * np.abs(wanted).max())


def test_a_branched_urdf(files: Path) -> None:
    robot = read_quietly(files / "branched.urdf")
    check(robot, urdf_segments(files / "branched.urdf"), {"left_arm_shoulder": "left arm/shoulder"})


def test_an_mjcf_with_several_joints_in_a_body(files: Path) -> None:
    check(read_quietly(files / "gimbal.xml"), mjcf_segments(files / "gimbal.xml"))


@pytest.mark.parametrize("file", REAL)
def test_real_urdfs(real: Path, file: str) -> None:
    check(read_quietly(real / file), urdf_segments(real / file))


@pytest.mark.parametrize("file", ["branched.urdf", "gimbal.xml", "quadruped.xml"])
def test_a_saved_robot_is_the_same(files: Path, file: str) -> None:
    robot = read_quietly(files / file)
    again = robot_from_toml(robot_to_toml(robot))
    assert again == robot
    np.testing.assert_array_equal(random_states(again).force, random_states(robot).force)
