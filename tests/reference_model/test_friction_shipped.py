"""The friction of the shipped flexible robots: the law in surface coordinates, and its effect in motion."""

from __future__ import annotations

import numpy as np
import pytest

from reference_model.simulation import simulate
from robot_model import Robot, load_robot

MU_D, MU_S, SIGMA, V_S = 0.10, 0.15, (1e4, 100.0, 0.4), 0.01
PRELOAD = 200.0
ROBOTS = ("flexible_space_robot", "flexible_space_robot_planar")


@pytest.mark.parametrize("name", ROBOTS)
def test_shipped_parameters_follow_from_surface_coefficients(name: str) -> None:
    robot = load_robot(name)
    for joint in robot.moving_joints:
        bearing = joint.bearing
        assert bearing is not None
        radius, preload = bearing.radial_arm, bearing.axial_arm * PRELOAD
        found = {use.effect: use.parameters for use in robot.effects if use.at == joint.name}
        assert found["lugre_friction"] == pytest.approx(
            {
                "coulomb_torque": MU_D * preload,
                "static_torque": MU_S * preload,
                "stribeck_velocity": V_S / radius,
                "bristle_stiffness": SIGMA[0] * radius * preload,
                "bristle_damping": SIGMA[1] * radius * preload,
                "load_coefficient": MU_D,
                "load_static_coefficient": MU_S,
                "load_stiffness": SIGMA[0] * radius,
                "load_damping": SIGMA[1] * radius,
                "load_viscosity": SIGMA[2] * radius,
            }
        )
        assert found["viscous_friction"] == pytest.approx({"coefficient": SIGMA[2] * radius * preload})


@pytest.mark.parametrize("name", ROBOTS)
def test_sliding_friction_is_the_level_of_load_and_preload(name: str) -> None:
    robot = load_robot(name)
    reference = robot.reference.model_copy(update={"duration": 12.0, "sample_rate": 100.0})
    robot = Robot.model_validate({**robot.model_dump(), "sensors": (), "reference": reference.model_dump()})
    recording = simulate(robot, sensors=False)
    assert recording["robot.loop_residual"].max() < 1e-12
    for joint in ("joint1", "joint2"):
        speed, load = recording[f"{joint}.velocity"], recording[f"{joint}.load_moment"] + 10.0
        fast = np.abs(speed) > 0.02
        assert fast.sum() > 500
        surface = 0.04 * speed
        level = MU_D + (MU_S - MU_D) * np.exp(-((surface / V_S) ** 2))
        wanted = -load * (level * np.sign(speed) + SIGMA[2] * surface)
        # Bristles are 4e-4 rad behind, over which speed and level change by less than 1 % here.
        np.testing.assert_allclose(recording[f"{joint}.friction_torque"][fast], wanted[fast], rtol=0.01)
    # Friction is inside the robot: momentum stays what it was, to the integration's tolerance.
    for axis in "xyz":
        assert np.abs(recording[f"robot.angular_momentum.{axis}"]).max() < 1e-5
