"""Controllers of a free base and friction feed-forward: against the reference engine, in closed loop."""

from __future__ import annotations

import numpy as np
import pytest
from exudyn_robots import GRAVITY, tumbling_robot
from flexible_robots import free_robot

from exudyn_model import simulate
from reference_model.simulation import simulate as reference_simulate
from robot_model import Bearing, ComputedTorque, Cycloid, InputError, JointPD, Recording, Reference, Robot

#: Tolerances of the reference run; its own error is then well below the differences asserted here.
TIGHT = {"rtol": 1e-10, "atol": 1e-12}

MOTIONS = (
    Cycloid(joint="elbow", displacement=0.9, duration=0.8),
    Cycloid(joint="shoulder", displacement=-0.7, duration=0.8),
)
HELD = {"base_kp": 25.0, "base_kd": 10.0}
CONTROLLERS = {
    "held": ComputedTorque(kp=100.0, kd=20.0, **HELD),
    "held and sampled": ComputedTorque(kp=100.0, kd=20.0, sample_time=5e-3, **HELD),
    "held, friction fed forward": ComputedTorque(
        kp=100.0, kd=20.0, load_feedforward=0.3, coulomb_feedforward=0.5, **HELD
    ),
    "free, friction fed forward": ComputedTorque(kp=100.0, kd=20.0, load_feedforward=0.3),
    "pd, friction fed forward": JointPD(
        kp=100.0, kd=20.0, load_feedforward=(0.3, 0.1, 0.2), gravity_feedforward=True
    ),
}


def robot_with(controller: ComputedTorque | JointPD) -> Robot:
    robot = tumbling_robot(
        gravity=GRAVITY,
        reference=Reference(duration=0.1, sample_rate=100.0, joints=MOTIONS),
    )
    bearing = Bearing(radial_arm=0.05, axial_arm=0.04, span=0.2)
    joints = tuple(joint.model_copy(update={"bearing": bearing}) for joint in robot.joints)
    return robot.model_copy(update={"joints": joints, "controller": controller})


def largest(first: Recording, second: Recording, quantity: str) -> float:
    names = [name for name in first if name.split(".")[1] == quantity]
    return max((float(np.abs(first[name] - second[name]).max()) for name in names), default=0.0)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_the_engines_agree_in_closed_loop(name: str) -> None:
    robot = robot_with(CONTROLLERS[name])
    mine, theirs = simulate(robot, sensors=False), reference_simulate(robot, sensors=False, **TIGHT)
    # h^2/12 of accelerations of 100 rad/s^2 that the gains change within 0.1 s; torques are 500 N m.
    assert largest(mine, theirs, "position") < 5e-6
    assert largest(mine, theirs, "attitude") < 5e-6
    assert largest(mine, theirs, "torque") < 2e-3
    assert largest(mine, theirs, "control_force") < 2e-3
    assert largest(mine, theirs, "control_torque") < 2e-3


def test_a_held_base_stays_and_needs_bodies_and_constraints() -> None:
    robot = robot_with(CONTROLLERS["held"])
    found = simulate(robot, sensors=False)
    # The nominal model is the true one and the base begins where it is held: nothing moves it.
    for axis in "xyz":
        moved = found[f"base.position.{axis}"] - found[f"base.position.{axis}"][0]
        np.testing.assert_allclose(moved, 0.0, atol=1e-6)
    assert "base.control_torque.z" in found
    with pytest.raises(InputError, match="the wrench that holds its base"):
        simulate(robot, formulation="tree")


def test_full_computed_torque_is_refused_on_a_flexible_robot() -> None:
    robot = free_robot(controller=ComputedTorque(model="full", kp=4.0, kd=4.0))
    with pytest.raises(InputError, match="knows the rigid model only"):
        simulate(robot)
