"""Bodies and constraints: against the tree, against the reference model's loads, and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from exudyn_robots import GRAVITY, joint, pendulum, tumbling_robot

from exudyn_model import simulate
from exudyn_model.bodies.bearing import Load
from reference_model.simulation import simulate as reference_simulate
from robot_model import Actuator, Bearing, EffectUse, InputError, Joint, JointPD, Recording, Reference, Robot

#: Tolerances of the reference run; its own error is then well below the differences asserted here.
TIGHT = {"rtol": 1e-11, "atol": 1e-13}

SHORT = Reference(duration=0.1, sample_rate=100.0)
GEARED = Actuator(gear_ratio=40.0, rotor_inertia=1e-3)
LOADS = ("radial_force", "axial_force", "bending_moment", "load_moment")


def use(effect: str, at: str, **parameters: float) -> EffectUse:
    return EffectUse.model_validate({"effect": effect, "at": at, **parameters})


def borne(robot: Robot, bearing: Bearing) -> Robot:
    """The robot with this bearing in every joint."""
    joints = tuple(joint.model_copy(update={"bearing": bearing}) for joint in robot.joints)
    return robot.model_copy(update={"joints": joints})


def largest(first: Recording, second: Recording, quantities: tuple[str, ...]) -> float:
    """Largest difference of these quantities, over all places and instants."""
    names = [name for name in first if name.split(".")[1] in quantities]
    assert names
    return max(float(np.abs(first[name] - second[name]).max()) for name in names)


def test_bodies_and_tree_give_the_same_motion() -> None:
    robot = tumbling_robot(reference=SHORT, gravity=GRAVITY)
    tree = simulate(robot, sensors=False, formulation="tree")
    bodies = simulate(robot, sensors=False, formulation="redundant")
    assert set(tree) < set(bodies)
    # Both are of second order, h^2/12 of the third derivative, with different coordinates: a few 1e-7.
    assert largest(tree, bodies, ("position", "attitude")) < 1e-6
    assert largest(tree, bodies, ("velocity", "acceleration", "linear_acceleration")) < 2e-5


@pytest.mark.parametrize("bearing", [Bearing(radial_arm=0.05, axial_arm=0.04, bending_arm=0.2), None])
def test_constraint_forces_are_the_reference_models_loads(bearing: Bearing | None) -> None:
    bearing = bearing or Bearing(radial_arm=0.05, axial_arm=0.04, span=0.3)
    robot = borne(tumbling_robot(reference=SHORT, gravity=GRAVITY), bearing)
    theirs = reference_simulate(robot, sensors=False, **TIGHT)
    coarse, fine = (
        largest(simulate(robot, sensors=False, step=step, formulation="redundant"), theirs, LOADS)
        for step in (1e-3, 5e-4)
    )
    # Forces of some 50 N follow the accelerations, whose error falls at second order: by 4.
    assert fine < 2e-4
    assert fine < coarse / 3


def test_momentum_and_energy_are_the_reference_models() -> None:
    robot = tumbling_robot(reference=SHORT)
    mine = simulate(robot, sensors=False, formulation="redundant")
    theirs = reference_simulate(robot, sensors=False, **TIGHT)
    # Of 20 N s, 20 N m s and 20 J, by the error of the velocities at this step, 1e-6.
    assert largest(mine, theirs, ("linear_momentum", "angular_momentum", "energy")) < 5e-5


def test_a_rotor_on_a_fixed_base_has_energy_but_no_momentum() -> None:
    # 40^2 x 1e-3 kg m^2 at the joint is as much as the rod itself has about it.
    driven = joint("hinge", axis=(0.0, 1.0, 0.0), initial_position=0.5, actuator=GEARED)
    robot = pendulum(joints=(driven,), reference=SHORT)
    mine = simulate(robot, sensors=False, formulation="redundant")
    theirs = reference_simulate(robot, sensors=False, **TIGHT)
    assert np.ptp(theirs["robot.angular_momentum.y"]) > 0.01
    assert largest(mine, theirs, ("linear_momentum", "angular_momentum", "energy")) < 1e-6


LUGRE = {
    "coulomb_torque": 0.1,
    "static_torque": 0.2,
    "stribeck_velocity": 0.1,
    "bristle_stiffness": 500.0,
    "bristle_damping": 2.0,
    "load_coefficient": 0.3,
    "load_static_coefficient": 0.5,
    "load_stiffness": 300.0,
    "load_damping": 2.0,
    "load_viscosity": 0.05,
}
FRICTION = {
    "load": use("load_dependent_friction", "shoulder", coefficient=0.5, gear_share=0.1),
    "guide": use("load_dependent_friction", "slide", coefficient=0.5, gear_share=0.0),
    "lugre": use("lugre_friction", "shoulder", **LUGRE),
}


@pytest.mark.parametrize("name", FRICTION)
def test_friction_in_proportion_to_the_load_is_the_reference_models(name: str) -> None:
    bearing = Bearing(radial_arm=0.05, axial_arm=0.04, span=0.2)
    robot = borne(tumbling_robot(reference=SHORT), bearing).with_effects(FRICTION[name])
    mine, theirs = simulate(robot, sensors=False), reference_simulate(robot, sensors=False, **TIGHT)
    place = FRICTION[name].at
    assert np.abs(theirs[f"{place}.friction_torque"]).max() > 0.05  # there is friction to speak of
    # Loads and friction are closed within the step, so no lag: second order, 1e-6 of the motion. A bristle
    # of 1/500 rad is passed in ten steps and its path known to 1 %.
    assert largest(mine, theirs, ("position",)) < 2e-5
    assert largest(mine, theirs, ("friction_torque",)) < 2e-3


def test_a_swinging_pendulum_loads_its_hinge() -> None:
    robot = pendulum(
        joints=(
            Joint(
                name="hinge",
                parent="base",
                child="rod",
                axis=(0.0, 1.0, 0.0),
                initial_position=0.7,
                initial_velocity=1.0,
            ),
        )
    )
    found = simulate(robot, sensors=False, formulation="redundant")
    q, v, a = (found[f"hinge.{name}"] for name in ("position", "velocity", "acceleration"))
    mass, arm, g = 2.0, 0.5, 9.81
    # In the rod's axes: along it m (l v^2 + g cos q), across it m (l a + g sin q).
    force = mass * np.hypot(arm * v**2 + g * np.cos(q), arm * a + g * np.sin(q))
    np.testing.assert_allclose(found["hinge.radial_force"], force, rtol=1e-6)
    np.testing.assert_allclose(found["hinge.axial_force"], 0.0, atol=1e-8)
    np.testing.assert_allclose(found["hinge.bending_moment"], 0.0, atol=1e-8)


def test_two_bearings_share_force_and_moment_as_vectors() -> None:
    axis = np.array([0.0, 0.0, 1.0])
    load = Load(np.array([6.0, 0.0, 0.0]), -2.0, np.array([0.0, 1.5, 0.0]), axis)
    # H x N / b = (-1.5, 0, 0) / 0.5: the bearings carry 3 - 3 and 3 + 3 N.
    pair = Bearing(radial_arm=0.1, axial_arm=0.2, span=0.5)
    assert load.friction_moment(pair) == pytest.approx(0.2 * 2 + 0.1 * (0 + 6))
    single = Bearing(radial_arm=0.1, axial_arm=0.2, bending_arm=0.25)
    assert load.friction_moment(single) == pytest.approx(0.2 * 2 + 0.1 * 6 + 0.1 / 0.25 * 1.5)


def test_engines_agree_on_jumps_of_a_sampled_controller() -> None:
    control = JointPD(kp=(40.0, 60.0, 200.0), kd=(4.0, 6.0, 20.0), sample_time=5e-3)
    robot = tumbling_robot(reference=SHORT, controller=control)
    tree = simulate(robot, sensors=False, formulation="tree")
    bodies = simulate(robot, sensors=False, formulation="redundant")
    # Accelerations and constraint forces are made consistent after every jump of the torques; a step that
    # missed one would be late by half a millisecond of 100 rad/s^2, 0.05 rad/s.
    assert largest(tree, bodies, ("velocity",)) < 2e-4
    assert largest(tree, bodies, ("acceleration",)) < 2e-2


def test_the_tree_refuses_loads() -> None:
    robot = tumbling_robot().with_effects(FRICTION["load"])
    with pytest.raises(InputError, match="friction that depends on bearing loads"):
        simulate(robot, formulation="tree")
