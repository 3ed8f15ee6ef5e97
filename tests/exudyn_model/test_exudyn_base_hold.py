"""Controllers of a free base and friction feed-forward: against the reference engine, in closed loop."""

from __future__ import annotations

import numpy as np
import pytest
from exudyn_robots import GRAVITY, tumbling_robot
from flexible_robots import free_robot
from quick_ones import quick_names

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


@pytest.mark.parametrize(
    "name",
    quick_names(CONTROLLERS, "held and sampled", "held, friction fed forward"),
)
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
    # The nominal model is the true one and the base starts where it is held: nothing moves it.
    for axis in "xyz":
        moved = found[f"base.position.{axis}"] - found[f"base.position.{axis}"][0]
        np.testing.assert_allclose(moved, 0.0, atol=1e-6)
    assert "base.control_torque.z" in found
    with pytest.raises(InputError, match="the wrench that holds its base"):
        simulate(robot, formulation="tree")


def moving_flexible_robot(**gains: float) -> Robot:
    motions = tuple(motion.model_copy(update={"duration": 0.4}) for motion in MOTIONS)
    return free_robot(
        controller=ComputedTorque(model="full", kp=100.0, kd=20.0, **gains),
        reference=Reference(duration=0.1, sample_rate=100.0, joints=motions),
    )


@pytest.mark.proof
@pytest.mark.parametrize("gains", [{}, HELD], ids=["free", "held"])
def test_full_computed_torque_of_a_flexible_robot_converges_at_second_order(gains: dict[str, float]) -> None:
    robot = moving_flexible_robot(**gains)
    theirs = reference_simulate(robot, sensors=False, **TIGHT)
    coarse, fine = (simulate(robot, sensors=False, step=h, integrator="trapezoidal") for h in (1e-3, 5e-4))
    for quantity in ("position", "torque", "modal_coordinate", "tip_deflection"):
        gap = largest(fine, theirs, quantity)
        assert largest(coarse, theirs, quantity) / gap == pytest.approx(4.0, abs=0.3), quantity


def test_full_computed_torque_leaves_no_error_on_its_own_model() -> None:
    """On its own model it decouples the joints, so that there is no tracking error."""
    robot = moving_flexible_robot().model_copy(update={"effects": ()})
    start = [joint.model_copy(update={"initial_velocity": 0.0}) for joint in robot.joints]
    robot = robot.model_copy(update={"joints": tuple(start)})
    found = simulate(robot, sensors=False, step=5e-4)
    for name in ("shoulder", "elbow"):
        # It begins on the reference and stays, bent as the link is: h^2/12 of accelerations of 35 rad/s^2.
        np.testing.assert_allclose(
            found[f"{name}.position"], found[f"{name}.reference_position"], rtol=0, atol=8e-7
        )


def test_full_computed_torque_needs_modes() -> None:
    with pytest.raises(InputError, match="'boom', which a geometrically exact beam does not have"):
        simulate(moving_flexible_robot(), flexible="beam")


@pytest.mark.parametrize(
    "controller",
    [
        ComputedTorque(kp=100.0, kd=20.0),
        pytest.param(JointPD(kp=100.0, kd=20.0, gravity_feedforward=True), marks=pytest.mark.proof),
    ],
    ids=["computed torque", "gravity feed-forward"],
)
def test_controllers_support_spherical_joints(controller: ComputedTorque | JointPD) -> None:
    robot = free_robot(gravity=GRAVITY, reference=Reference(duration=0.06, sample_rate=100.0))
    ball = robot.joints[1].model_copy(update={"kind": "spherical", "actuator": None})
    given = {"joints": (robot.joints[0], ball), "effects": ()}
    hanging = robot.model_copy(update={**given, "controller": controller})
    mine = simulate(hanging, sensors=False, step=2.5e-4)
    theirs = reference_simulate(hanging, sensors=False, **TIGHT)
    # A bent link that falls about a ball: (w h)^2/12 of its modes' share in torques of 100 N m.
    assert largest(mine, theirs, "position") < 1e-6
    assert largest(mine, theirs, "torque") < 1e-2
