"""Both engines on the same robot, friction and control: trajectories, not only formulas."""

from __future__ import annotations

import numpy as np
import pytest
from exudyn_robots import GRAVITY, tumbling_robot
from quick_ones import quick_names

from exudyn_model import simulate
from reference_model.simulation import simulate as reference_simulate
from robot_model import (
    ComputedTorque,
    Cycloid,
    EffectUse,
    JointPD,
    Recording,
    Reference,
    Robot,
    VoltageServo,
    load_robot,
)

#: Tolerances of the reference run; its own error is then well below the differences asserted here.
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def use(effect: str, at: str, **parameters: float) -> EffectUse:
    return EffectUse.model_validate({"effect": effect, "at": at, **parameters})


def short(name: str, *, duration: float = 0.6, **changes: object) -> Robot:
    """A shipped robot, run for a short time in which each joint of the arm reverses."""
    robot = load_robot(name)
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": duration, "sample_rate": 200.0})
    return robot.model_copy(update={"reference": reference, **changes})


def largest(first: Recording, second: Recording, quantity: str) -> float:
    """Largest difference of a quantity over all joints and instants."""
    channels = [name for name in first if name.endswith(f".{quantity}")]
    return max(float(np.abs(first[name] - second[name]).max()) for name in channels)


LUGRE = {
    "coulomb_torque": 3.0,
    "static_torque": 5.0,
    "stribeck_velocity": 0.05,
    "bristle_stiffness": 2e3,
    "bristle_damping": 8.0,
}

CASES = {
    "two_link_arm": short("two_link_arm"),
    "coulomb": short("two_link_arm").with_effects(use("coulomb_friction", "joint1", torque=5.0)),
    "stribeck": short("two_link_arm").with_effects(
        use("stribeck_friction", "joint2", coulomb_torque=1.0, static_torque=2.0, stribeck_velocity=0.05)
    ),
    "lugre": short("two_link_arm").with_effects(use("lugre_friction", "joint1", **LUGRE)),
    "single_axis": short("single_axis"),
    "sampled": short(
        "two_link_arm", controller=JointPD(kp=(900.0, 300.0), kd=(80.0, 20.0), sample_time=4e-3)
    ),
    "integral": short(
        "two_link_arm", controller=JointPD(kp=900.0, kd=80.0, ki=2000.0, gravity_feedforward=True)
    ),
    "drive": short("two_link_arm").with_effects(
        use("actuator_lag", "joint1", time_constant=0.01),
        use("torque_gain", "joint1", gain_error=0.05),
        use("torque_ripple", "joint2", cosine=0.5, sine=0.2, order=20.0),
        use("torque_saturation", "joint1", limit=40.0),
        use("cable_spring", "joint2", stiffness=2.0, torque_at_zero=0.5),
        use("external_torque", "joint2", torque=2.0, start=0.2, duration=0.2),
        use("payload", "link2", mass=1.5, x=0.4),
        use("gravity", "base", x=0.3),
    ),
    "computed_torque": short("two_link_arm", controller=ComputedTorque(kp=400.0, kd=40.0)).with_effects(
        use("coulomb_friction", "joint2", torque=1.0)
    ),
}


@pytest.mark.parametrize("name", quick_names(CASES, "two_link_arm", "stribeck", "lugre", "sampled", "drive"))
def test_the_engines_agree(name: str) -> None:
    robot = CASES[name]
    mine = simulate(robot, sensors=False, step=5e-4)
    theirs = reference_simulate(robot, sensors=False, **TIGHT)
    np.testing.assert_array_equal(mine.time, theirs.time)
    # The error of half the default step: 1e-6 rad or m through a reversal of dry friction, below encoders.
    assert largest(mine, theirs, "position") < 1e-6
    assert largest(mine, theirs, "velocity") < 2e-5
    assert largest(mine, theirs, "reference_position") < 1e-14


@pytest.mark.parametrize("name", quick_names(["two_link_arm", "single_axis", "lugre"], "two_link_arm"))
def test_the_difference_decreases_with_the_step(name: str) -> None:
    robot = CASES[name]
    theirs = reference_simulate(robot, sensors=False, **TIGHT)
    coarse, fine = (
        largest(simulate(robot, sensors=False, step=step), theirs, "position") for step in (1e-3, 2.5e-4)
    )
    # Second order would be 16; steps that error control cut at reversals make it a little less regular.
    assert fine < coarse / 8


def test_the_engines_agree_on_a_free_base() -> None:
    motions = (
        Cycloid(joint="elbow", displacement=0.9, duration=0.8),
        Cycloid(joint="shoulder", displacement=-0.7, duration=0.8),
    )
    robot = tumbling_robot(
        gravity=GRAVITY,
        controller=ComputedTorque(kp=100.0, kd=20.0),
        reference=Reference(duration=0.2, sample_rate=100.0, joints=motions),
    ).with_effects(
        use("coulomb_friction", "shoulder", torque=2.0), use("viscous_friction", "slide", coefficient=4.0)
    )
    mine, theirs = simulate(robot, sensors=False), reference_simulate(robot, sensors=False, **TIGHT)
    shared = [name for name in mine if name in theirs]
    assert {"base.attitude.w", "base.position.z", "base.linear_acceleration.x"} < set(shared)
    for name in shared:
        # Motion: h^2/12 of accelerations of 60 rad/s^2 that change within 0.1 s, 1e-5. Accelerations and
        # friction see the velocity's error through the friction's slope, 2 N m per 1e-4 rad/s.
        direct = name.split(".")[1] in ("position", "velocity", "attitude", "angular_velocity")
        np.testing.assert_allclose(mine[name], theirs[name], atol=2e-5 if direct else 0.05, err_msg=name)


def test_the_engines_agree_on_a_servo() -> None:
    robot = load_robot("two_link_arm")
    actuators = [joint.actuator for joint in robot.joints]
    joints = tuple(
        joint.model_copy(
            update={"actuator": actuator.model_copy(update={"torque_constant": 0.05, "resistance": 0.5})}
        )
        for joint, actuator in zip(robot.joints, actuators)
        if actuator is not None
    )
    servo = short(
        "two_link_arm", joints=joints, controller=VoltageServo(gain=8.0, supply=24.0, sample_time=0.01)
    )
    mine, theirs = simulate(servo, sensors=False), reference_simulate(servo, sensors=False, **TIGHT)
    assert largest(mine, theirs, "position") < 1e-6
    # At a tick one engine may report the output before, the other after it; between ticks they agree.
    between = np.arange(len(mine.time)) % 2 == 1
    for channel in ("joint1.voltage", "joint2.voltage"):
        np.testing.assert_allclose(mine[channel][between], theirs[channel][between], atol=2e-3)
