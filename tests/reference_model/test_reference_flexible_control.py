"""Computed torque on robots with flexible links: with and without knowledge of the deformation."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from test_reference_decoupling import closed_form, disturbed, flow

from reference_model.control.motion import reference_function
from reference_model.evaluation.model import RobotModel
from reference_model.flexible import flexible_body
from reference_model.flexible.undeformed import undeformed
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from robot_model import Base, ComputedTorque, Cycloid, EffectUse, Recording, Reference, Robot, load_robot

FULL = ComputedTorque(model="full", kp=9.0, kd=4.0)
HELD = FULL.model_copy(update={"base_kp": 4.0, "base_kd": 3.0})
#: Of the shipped robot's fast manoeuvre here [s].
MOTION, HOLD = 4.0, 4.0


def space_robot(controller: ComputedTorque, **changes: object) -> Robot:
    """The shipped robot without noise, friction and torque limits, in half of its motion and quicker."""
    robot = load_robot("flexible_space_robot")
    steps = {"joint1": 0.2, "joint2": -0.3}
    joints = tuple(Cycloid(joint=name, displacement=d, duration=MOTION) for name, d in steps.items())
    reference = Reference(duration=MOTION + HOLD, sample_rate=100.0, joints=joints)
    unlimited = tuple(
        joint.model_copy(update={"actuator": joint.actuator.model_copy(update={"torque_limit": None})})
        for joint in robot.joints
        if joint.actuator
    )
    settings = {"controller": controller, "reference": reference, "sensors": (), "joints": unlimited}
    settings["effects"] = ()
    return robot.model_copy(update={**settings, **changes})


@cache
def run(controller: ComputedTorque) -> Recording:
    return simulate(space_robot(controller), sensors=False)


def errors(recording: Recording) -> np.ndarray:
    names = ("joint1", "joint2")
    return np.stack(
        [recording[f"{n}.reference_position"] - recording[f"{n}.position"] for n in names], axis=1
    )


def tip(recording: Recording) -> np.ndarray:
    return np.stack([recording[f"link2.tip_deflection.{axis}"] for axis in "yz"], axis=1)


def bent(plant: Plant, seed: int) -> np.ndarray:
    """A state off the reference everywhere, the link bent by some centimetres and vibrating."""
    return disturbed(plant, np.random.default_rng(seed))


def with_pendulum(robot: Robot) -> Robot:
    """A body hanging on a ball at the tip of link 2."""
    data = robot.model_dump()
    body = {"name": "bob", "mass": 8.0, "center_of_mass": (0.3, 0.1, -0.2), "inertia": (0.5, 0.6, 0.7)}
    ball = {"name": "ball", "kind": "spherical", "parent": "link2", "child": "bob", "origin": (6.0, 0.0, 0.0)}
    return Robot.model_validate({**data, "links": [*data["links"], body], "joints": [*data["joints"], ball]})


@pytest.mark.parametrize("base", ["fixed", "free", "held", "ball"])
def test_full_computed_torque_gives_exactly_the_desired_accelerations(base: str) -> None:
    robot = space_robot(HELD if base == "held" else FULL, gravity=(0.0, 1.0, -2.0))
    if base == "fixed":
        robot = robot.model_copy(update={"base": Base(rpy=(0.3, -0.2, 0.5))})
    if base == "ball":
        robot = with_pendulum(robot)
    plant = Plant(robot)
    for seed in (1, 2):
        state = bent(plant, seed)
        parts = plant.layout.split(state)
        assert np.abs(parts["modal"]).max() > 0.05
        goal = [column.full().ravel() for column in reference_function(robot)(1.3)]
        command = plant.command(1.3, state, *goal)
        found = plant.watch(1.3, state, goal[0], command)[1].full().ravel()
        start = 0 if base == "fixed" else 6
        wanted = goal[2] + 4 * (goal[1] - parts["velocity"]) + 9 * (goal[0] - parts["position"])
        # rounding of some thousand newton-metres over an effective inertia of three
        np.testing.assert_allclose(found[start : start + 2], wanted, atol=1e-9)
        if base == "held":
            linear = found[:3] + 3 * parts["base_velocity"][:3]
            # the force of a spring to the origin, turned into base axes, has the length of the way
            np.testing.assert_allclose(
                np.linalg.norm(linear), 4 * np.linalg.norm(parts["base_position"]), rtol=1e-9
            )


def test_errors_of_the_flexible_robot_decay_with_the_rates_of_the_gains() -> None:
    robot = space_robot(HELD)
    plant = Plant(robot)
    start, time = bent(plant, 4), np.linspace(0, 2, 41)
    states = flow(plant, start, time)
    found = plant.layout.split(states)
    goal = np.array([np.hstack([c.full().ravel() for c in reference_function(robot)(t)]) for t in time])
    error, rate = goal[:, :2] - found["position"], goal[0, 2:4] - found["velocity"][0]
    assert np.abs(found["modal"][-1]).max() > 0.05  # the link goes on vibrating all the same
    # 1e-11 a step over some thousand steps
    np.testing.assert_allclose(error, closed_form(9.0, 4.0, error[0], rate, time), atol=1e-7)


def test_with_exact_joint_motion_the_link_vibrates_as_clamped() -> None:
    """Nothing damps it but itself: with joints and base at rest the modes keep their clamped frequencies."""
    recording = run(HELD)
    assert np.abs(errors(recording)).max() < 1e-6
    body = flexible_body(load_robot("flexible_space_robot").link("link2"))
    after = recording.time > MOTION + 0.1
    time = recording.time[after] - MOTION
    for place, axis in ((0, "y"), (1, "z")):
        y = recording[f"link2.tip_deflection.{axis}"][after]
        w, decay = body.frequencies[place], body.damping[place, place] / 2
        shift = np.sqrt(w**2 - decay**2) * time
        basis = np.exp(-decay * time)[:, None] * np.column_stack([np.cos(shift), np.sin(shift)])
        left = y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]
        # the second pair of modes, at fourteen times the frequency, is hardly excited by a cycloid
        assert np.abs(left).max() < 0.02 * np.abs(y).max()
        assert np.abs(y).max() > 1e-4


def test_rigid_computed_torque_leaves_errors_and_vibration() -> None:
    rigid = ComputedTorque(kp=1.0, kd=2.0, base_kp=1.0, base_kd=2.0)
    recording = run(rigid)
    assert np.abs(errors(recording)).max() > 1e-4  # the deformation acts on it as a disturbance
    moving = recording.time < MOTION
    assert np.abs(tip(recording)[moving]).max() > 5e-3
    after = tip(recording)[recording.time > MOTION]
    assert np.ptp(after, axis=0).max() > 1e-4  # residual vibration
    assert np.abs(after[-100:]).max() < np.abs(after[:100]).max()  # yielding joints damp it


@pytest.mark.parametrize("model", ["rigid", "full"])
def test_a_free_base_gets_no_momentum_from_either_controller(model: str) -> None:
    recording = run(ComputedTorque(model=model, kp=1.0, kd=2.0))  # type: ignore[arg-type]
    for kind in ("linear", "angular"):
        found = [recording[f"robot.{kind}_momentum.{axis}"] for axis in "xyz"]
        # 1e-8 a step of partial momenta of some hundred
        assert np.abs(found).max() < 1e-6
    turned = np.abs(recording["base.attitude.z"]).max()
    assert turned > 1e-3  # the base reacts


def test_a_constant_torque_causes_the_error_of_the_effective_inertia() -> None:
    """e = -Zbar^-1 T / kp with Zbar = Z_qq - Z_qx Z_xx^-1 Z_xq: what Coulomb friction of that size does."""
    torque = np.array([-1.0, 0.5])
    pushed = tuple(
        EffectUse.model_validate(
            {"effect": "external_torque", "at": name, "torque": value, "start": 0.1, "duration": 1e5}
        )
        for name, value in zip(("joint1", "joint2"), torque)
    )
    still = Reference(duration=15.0, sample_rate=20.0)
    controller = FULL.model_copy(update={"kp": 25.0, "kd": 10.0})
    robot = space_robot(controller, reference=still, effects=pushed, base=Base())
    rod, arm = robot.links
    assert arm.beam is not None
    damped = arm.model_copy(update={"beam": arm.beam.model_copy(update={"damping_ratio": 0.3})})
    robot = robot.model_copy(update={"links": (rod, damped)})
    found = errors(simulate(robot, sensors=False))[-1]
    matrix = RobotModel(robot).mass_matrix(-found[None])[0]
    joints, modal = slice(0, 2), slice(2, None)
    effective = matrix[joints, joints] - matrix[joints, modal] @ np.linalg.solve(
        matrix[modal, modal], matrix[modal, joints]
    )
    # exp(-5 * 15) of the joints' transient is left, and exp(-0.3 * 5.4 * 15) of the link's
    np.testing.assert_allclose(found, -np.linalg.solve(effective, torque) / 25.0, rtol=1e-6)
    rigid = RobotModel(undeformed(robot)).mass_matrix(-found[None])[0]
    assert rigid[1, 1] > 50 * effective[1, 1]  # why friction weighs so much more than on a rigid robot
