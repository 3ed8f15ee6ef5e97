"""Simulations: conservation, balances, agreement of the parts, convergence, and failures that say why."""

from __future__ import annotations

import numpy as np
import pytest
from random_robots import random_robot
from scipy.interpolate import CubicSpline

from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from reference_model.simulation import simulate
from robot_model import InputError, Recording, Robot

KINDS = ["revolute", "revolute", "prismatic"]
WAVES = {"kind": "multisine", "amplitudes": (0.3, 0.1), "frequencies": (0.4, 0.9), "ramp": 0.5}


def moving_robot(base: str, effects: list[dict], *, seed: int = 11, gravity: bool = False, **more) -> Robot:
    """Three joints that follow multisines under PD control."""
    settings = {
        "controller": {"kind": "pd", "kp": 200.0, "kd": 30.0},
        "reference": {
            "duration": 3.0,
            "sample_rate": 1000.0,
            "joints": [{"joint": f"joint{k}", **WAVES} for k in range(3)],
        },
        "effects": effects,
        **more,
    }
    robot = random_robot(seed, base=base, kinds=KINDS, gravity=gravity, **settings)
    bearing = {"radial_arm": 0.05, "axial_arm": 0.04, "bending_arm": 0.1}
    data = robot.model_dump()
    for joint in data["joints"]:
        joint["bearing"] = bearing
    return Robot.model_validate(data)


def columns(recording: Recording, robot: Robot, quantity: str) -> np.ndarray:
    return np.stack([recording[f"{joint.name}.{quantity}"] for joint in robot.moving_joints], axis=1)


def base_of(recording: Recording) -> BaseMotion:
    def axes(quantity: str, names: str = "xyz") -> np.ndarray:
        return np.stack([recording[f"base.{quantity}.{axis}"] for axis in names], axis=1)

    zero = np.zeros((len(recording), 3))
    acceleration = axes("linear_acceleration")
    return BaseMotion(
        axes("attitude", "wxyz"), axes("angular_velocity"), axes("linear_velocity"), zero, acceleration
    )


FRICTION = [
    {"effect": "coulomb_friction", "at": "joint0", "torque": 0.5},
    {
        "effect": "lugre_friction",
        "at": "joint1",
        "coulomb_torque": 0.6,
        "static_torque": 0.9,
        "stribeck_velocity": 0.02,
        "bristle_stiffness": 1e3,
        "bristle_damping": 2.0,
    },
    {"effect": "load_dependent_friction", "at": "joint1", "coefficient": 0.3, "gear_share": 0.0},
    {"effect": "viscous_friction", "at": "joint2", "coefficient": 3.0},
]


def test_a_free_robot_keeps_its_momentum_under_control_and_friction() -> None:
    robot = moving_robot("free", FRICTION)
    recording = simulate(robot, sensors=False, rtol=1e-9, atol=1e-11)
    speed = columns(recording, robot, "velocity")
    assert np.abs(speed).max() > 0.5  # it does move
    for axis in "xyz":
        # a start from rest: 1e-9 per step of momenta of order one, over some thousand steps
        assert np.abs(recording[f"robot.linear_momentum.{axis}"]).max() < 1e-6
        assert np.abs(recording[f"robot.angular_momentum.{axis}"]).max() < 1e-6
    assert "joint1.bristle" in recording


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_energy_changes_by_the_work_of_drives_and_friction(base: str) -> None:
    effects = [{"effect": "viscous_friction", "at": f"joint{k}", "coefficient": 2.0} for k in range(3)]
    robot = moving_robot(base, effects, gravity=True)
    recording = simulate(robot, sensors=False, rtol=1e-10, atol=1e-12)
    speed = columns(recording, robot, "velocity")
    force = columns(recording, robot, "torque") + columns(recording, robot, "friction_torque")
    work = CubicSpline(recording.time, np.sum(force * speed, axis=1)).antiderivative()(recording.time)
    change = recording["robot.energy"] - recording["robot.energy"][0]
    # splines at 1 kHz through motions below 50 rad/s: (0.05)^4 of a step's work
    np.testing.assert_allclose(change, work, atol=1e-6 * (1 + np.abs(work).max()))


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_recorded_torques_and_friction_explain_the_recorded_motion(base: str) -> None:
    robot = moving_robot(base, FRICTION, gravity=True)
    recording = simulate(robot, sensors=False)
    motion = [columns(recording, robot, name) for name in ("position", "velocity", "acceleration")]
    model, base_motion = RobotModel(robot), None
    if base == "free":  # angular acceleration is no channel: its own reconstruction gives it
        still = base_of(recording)
        first = BaseMotion.from_stacked(still.stacked()[:1])
        base_motion = model.reconstruct_base(recording.time, *motion, initial=first)
    need = model.inverse_dynamics(*motion, base=base_motion)
    given = columns(recording, robot, "torque") + columns(recording, robot, "friction_torque")
    tolerance = 1e-6 if base == "free" else 1e-9  # rounding; the reconstruction's and the integration's error
    np.testing.assert_allclose(need[:, -3:], given, atol=tolerance * (1 + np.abs(need).max()))


def test_load_dependent_friction_is_consistent_with_its_loads() -> None:
    """The loop is closed: friction is mu W(accelerations that this friction allows)."""
    effect = {"effect": "load_dependent_friction", "at": "joint1", "coefficient": 0.8, "gear_share": 0.0}
    robot = moving_robot("fixed", [effect], gravity=True)
    recording = simulate(robot, sensors=False)
    names = [joint.name for joint in robot.moving_joints]
    motion = [columns(recording, robot, name) for name in ("position", "velocity", "acceleration")]
    loads = RobotModel(robot).bearing_loads(*motion)[:, names.index("joint1")]
    bearing = robot.joint("joint1").bearing
    assert bearing is not None
    moment = loads @ [0.0, bearing.axial_arm, 0.0, bearing.radial_arm]
    by_hand = [bearing.radial_arm, bearing.axial_arm, bearing.radial_arm / bearing.bending_arm, 0.0]
    np.testing.assert_allclose(moment, loads @ by_hand, rtol=1e-12)
    wanted = -0.8 * moment * np.tanh(recording["joint1.velocity"] / 1e-4)
    assert np.ptp(moment) > 0.5  # the load does vary
    np.testing.assert_allclose(recording["joint1.friction_torque"], wanted, atol=1e-10)


def test_reconstructed_base_is_the_simulated_one() -> None:
    robot = moving_robot("free", FRICTION[3:])
    recording = simulate(robot, sensors=False, rtol=1e-10, atol=1e-12)
    motion = [columns(recording, robot, name) for name in ("position", "velocity", "acceleration")]
    found, wanted = RobotModel(robot).reconstruct_base(recording.time, *motion), base_of(recording)
    # both integrate: 1e-10 per step here, and there (h w)^4 = 1e-10 of a step's turn
    np.testing.assert_allclose(found.attitude, wanted.attitude, atol=1e-7)
    np.testing.assert_allclose(found.angular_velocity, wanted.angular_velocity, atol=1e-7)
    np.testing.assert_allclose(found.linear_velocity, wanted.linear_velocity, atol=1e-7)
    np.testing.assert_allclose(found.linear_acceleration, wanted.linear_acceleration, atol=1e-6)


def test_reconstruction_converges_with_fourth_order() -> None:
    robot = moving_robot("free", [])
    model, errors = RobotModel(robot), []

    def motion(time: np.ndarray) -> list[np.ndarray]:
        rates = np.array([3.0, 4.0, 5.0])
        phase = time[:, None] * rates
        return [np.sin(phase), rates * np.cos(phase), -(rates**2) * np.sin(phase)]

    start = BaseMotion([[1.0, 0, 0, 0]], [[0.3, -0.2, 0.4]], [[0.1, 0, 0]], *np.zeros((2, 1, 3)))
    finals = []
    for samples in (51, 101, 1601):
        time = np.linspace(0, 2, samples)
        finals.append(model.reconstruct_base(time, *motion(time), initial=start).attitude[-1])
    errors = [np.abs(final - finals[-1]).max() for final in finals[:2]]
    assert 10 < errors[0] / errors[1] < 25  # 16 for order four


def test_a_reconstructed_base_in_gravity_falls() -> None:
    robot = moving_robot("free", [], gravity=True)
    time = np.linspace(0, 1, 101)
    still = np.zeros((101, 3))
    base = RobotModel(robot).reconstruct_base(time, still, still, still)
    np.testing.assert_allclose(base.angular_velocity, 0, atol=1e-12)
    falling = np.outer(time, np.linalg.norm(robot.gravity))
    np.testing.assert_allclose(np.linalg.norm(base.linear_velocity, axis=1), falling[:, 0], atol=1e-12)


def test_error_falls_with_the_tolerance() -> None:
    robot = moving_robot("fixed", FRICTION[3:], gravity=True)
    fine = simulate(robot, sensors=False, rtol=1e-12, atol=1e-13)
    errors = []
    for tolerance in (1e-4, 1e-6, 1e-8):
        rough = simulate(robot, sensors=False, rtol=tolerance, atol=tolerance / 100)
        errors.append(np.abs(columns(rough, robot, "position") - columns(fine, robot, "position")).max())
    # steps shrink as the tolerance to the power 1/(order + 1), so two decades give a bit less than two
    assert errors[0] > 10 * errors[1] > 100 * errors[2] > 0


def test_a_simulation_is_the_same_each_time_and_its_noise_follows_the_seed() -> None:
    sensors = [{"channel": "joint0.torque", "noise": 0.1}, {"channel": "joint1.position", "noise": 1e-4}]
    robot = moving_robot("fixed", [], sensors=sensors)
    one, two, other = (simulate(robot, seed=seed) for seed in (1, 1, 2))
    for name in one:
        np.testing.assert_array_equal(one[name], two[name])
    assert np.any(one["joint0.torque"] != other["joint0.torque"])


def test_a_failed_integration_reports_time_and_state() -> None:
    wild = {"kind": "pd", "kp": -500.0, "kd": -500.0}
    robot = moving_robot("fixed", [], controller=wild)
    with pytest.raises(InputError, match=r"stopped after t = .* s .*joint0 at .* rad/s.*try"):
        simulate(robot)


def test_unsupported_robots_are_refused() -> None:
    robot = moving_robot("fixed", [])
    with pytest.raises(InputError, match="reference"):
        simulate(robot.model_copy(update={"reference": None}))
