"""Gear elasticity with a motor encoder only."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_arm import INERTIA, VISCOUS

from missing_physics.diagnosis import Result, diagnose
from missing_physics.evaluation import Band, evaluate
from robot_model import EffectUse, Recording, Robot, Sensor, robot_from_toml

ROTOR, STIFFNESS = 0.05, 60.0
NOISE = 0.01


@pytest.fixture(scope="module")
def geared(arm: Robot) -> Robot:
    (joint,) = arm.joints
    assert joint.actuator is not None
    motor = joint.actuator.model_copy(update={"rotor_inertia": ROTOR})
    sensors = (
        Sensor(channel="joint.motor_position", noise=1e-7),
        Sensor(channel="joint.torque", noise=NOISE),
    )
    friction = EffectUse(effect="viscous_friction", at="joint", coefficient=VISCOUS)
    whole = {"joints": (joint.model_copy(update={"actuator": motor}),), "sensors": sensors}
    return arm.model_copy(update=whole).with_effects(friction)


def recorded(stiffness: float, *, seed: int) -> Recording:
    """The joint moves by a sum of sines; the motor by what its gear winds up more. All is exact but noise."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 24.0, 5e-3)
    rates = 2.0 * np.pi * np.array([0.11, 0.23, 0.37, 0.61])
    sizes = np.array([0.9, 0.5, 0.3, 0.25])
    angle = rates * time[:, None] + random.uniform(0.0, 2.0 * np.pi, 4)

    def joint(order: int) -> np.ndarray:
        """A derivative of the joint's position."""
        return np.sin(angle + 0.5 * np.pi * order) @ (sizes * rates**order)

    def passed(order: int) -> np.ndarray:
        """A derivative of the torque that the gear transmits."""
        return INERTIA * joint(order + 2) + VISCOUS * joint(order + 1)

    torque = ROTOR * (joint(2) + passed(2) / stiffness) + passed(0)
    channels = {
        "joint.motor_position": joint(0) + passed(0) / stiffness + 1e-7 * random.standard_normal(time.size),
        "joint.torque": torque + NOISE * random.standard_normal(time.size),
    }
    return Recording(time, channels, f"seed {seed}")


@pytest.fixture(scope="module")
def result(geared: Robot) -> Result:
    return diagnose(geared, [recorded(STIFFNESS, seed=1)], [recorded(STIFFNESS, seed=2)])


def test_gear_stiffness_is_estimated_from_the_torque(result: Result) -> None:
    [found] = result.diagnosis.findings
    assert (found.effect, found.location) == ("joint_elasticity", "joint")
    stiffness = found.parameters["stiffness"]
    # Damping of the gear and a delay of the torque do nearly the same: what remains is known to a sixth.
    assert stiffness.ci95[0] < STIFFNESS < stiffness.ci95[1]
    assert stiffness.value == pytest.approx(STIFFNESS, rel=0.17)
    assert result.diagnosis.verdict == "explained"


def test_augmented_robot_with_gear_elasticity_predicts_the_torque(result: Result, geared: Robot) -> None:
    other = recorded(STIFFNESS, seed=3)
    files = robot_from_toml(result.augmented_robot_toml), geared
    after, before = (evaluate(file, other, Band(3.0, 15.0)).rms()["joint.torque"] for file in files)
    assert after < 0.2 * before


def test_a_stiff_gear_is_not_named(geared: Robot) -> None:
    result = diagnose(geared, [recorded(1e7, seed=1)], [recorded(1e7, seed=2)])
    assert result.diagnosis.verdict == "consistent"
    assert not result.diagnosis.findings
