"""Computed torque on rigid robots: decoupling, holding the base, residual error due to friction."""

from __future__ import annotations

import itertools

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_reference_control import axis
from test_reference_simulation import base_of, columns, moving_robot

from reference_model.control.laws import command_size
from reference_model.control.motion import reference_function
from reference_model.evaluation.model import RobotModel
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from robot_model import ComputedTorque, Robot

GAINS = {"kind": "computed_torque", "kp": 9.0, "kd": 4.0}
HELD = {**GAINS, "base_kp": 4.0, "base_kd": 3.0}


def closed_form(kp: float, kd: float, start: np.ndarray, rate: np.ndarray, time: np.ndarray) -> np.ndarray:
    """e'' + kd e' + kp e = 0 from e(0), e'(0), underdamped or not, shape (N, k)."""
    roots = np.roots([1.0, kd, kp]).astype(complex)
    weights = np.linalg.solve(np.vstack([np.ones(2), roots]), np.vstack([start, rate]).astype(complex))
    return np.real(np.exp(time[:, None] * roots) @ weights)


def flow(plant: Plant, state: np.ndarray, time: np.ndarray) -> np.ndarray:
    """States from any state on, shape (N, rows)."""
    reference = reference_function(plant.robot)
    t, x = ca.SX.sym("t"), ca.SX.sym("x", plant.layout.size)
    goal = reference(t)
    ode = plant.rate(t, x, goal[0], plant.command(t, x, *goal))
    options = {"reltol": 1e-11, "abstol": 1e-12, "max_num_steps": 100_000}
    solver = ca.integrator("flow", "cvodes", {"t": t, "x": x, "ode": ode}, 0.0, time[1:].tolist(), options)
    return np.vstack([state, solver(x0=state)["xf"].full().T])


def disturbed(plant: Plant, rng: np.random.Generator) -> np.ndarray:
    """A state off the reference everywhere: joints, their rates, and the base's pose and velocities."""
    state = plant.initial(reference_function(plant.robot)) + rng.normal(0, 0.2, plant.layout.size)
    parts = plant.layout.split(state)
    if plant.layout.free_base:
        parts["attitude"] /= np.linalg.norm(parts["attitude"])
    return state


@pytest.mark.parametrize("controller", [GAINS, HELD])
def test_every_state_gets_exactly_the_desired_accelerations(controller: dict) -> None:
    robot = moving_robot("free", [], controller=controller, gravity=True)
    plant, rng = Plant(robot), np.random.default_rng(3)
    for instant in (0.3, 1.7):
        state = disturbed(plant, rng)
        parts = plant.layout.split(state)
        goal = [column.full().ravel() for column in reference_function(robot)(instant)]
        command = plant.command(instant, state, *goal)
        found = plant.watch(instant, state, goal[0], command)[1].full().ravel()
        wanted = goal[2] + 4 * (goal[1] - parts["velocity"]) + 9 * (goal[0] - parts["position"])
        # rounding of forces of some thousand newtons over masses of a few kilograms
        np.testing.assert_allclose(found[6:], wanted, atol=1e-9)
        if controller is HELD:
            to_base = Rotation.from_quat(parts["attitude"], scalar_first=True).inv()
            back = Rotation.from_euler("xyz", robot.base.rpy) * to_base
            turn = 2 * back.as_quat(scalar_first=True, canonical=True)[1:]
            astray = np.concatenate([to_base.apply(-parts["base_position"]), to_base.apply(turn)])
            np.testing.assert_allclose(found[:6], 4 * astray - 3 * parts["base_velocity"], atol=1e-9)


def test_errors_of_joints_and_base_decay_with_the_rates_of_their_gains() -> None:
    robot = moving_robot("free", [], controller=HELD)
    plant = Plant(robot)
    start = disturbed(plant, np.random.default_rng(5))
    still = plant.initial(reference_function(robot))
    parts, rest = plant.layout.split(start), plant.layout.split(still)
    axis_angle = np.array([0.3, -0.4, 0.5])  # about a fixed axis from rest the turn stays about it
    tilt = Rotation.from_rotvec(axis_angle) * Rotation.from_euler("xyz", robot.base.rpy)
    parts["attitude"][:] = tilt.as_quat(scalar_first=True)
    parts["base_velocity"][3:] = 0
    time = np.linspace(0, 3, 61)
    states = flow(plant, start, time)
    found = plant.layout.split(states)
    goal = np.array([np.hstack([c.full().ravel() for c in reference_function(robot)(t)]) for t in time])
    count = plant.layout.joints
    errors = goal[:, :count] - found["position"]
    rates = goal[0, count : 2 * count] - found["velocity"][0]
    # 1e-11 a step over some hundred steps, and as much again through the inverse dynamics
    np.testing.assert_allclose(errors, closed_form(9.0, 4.0, errors[0], rates, time), atol=1e-8)
    place = found["base_position"] - rest["base_position"]
    speed = Rotation.from_quat(parts["attitude"], scalar_first=True).apply(parts["base_velocity"][:3])
    np.testing.assert_allclose(place, closed_form(4.0, 3.0, place[0], speed, time), atol=1e-8)
    # the attitude: phi'' + kd phi' + 2 kp sin(phi/2) = 0 about the fixed axis
    back = Rotation.from_quat(found["attitude"], scalar_first=True)
    vectors = (back * Rotation.from_euler("xyz", robot.base.rpy).inv()).as_rotvec()
    phi, p = ca.SX.sym("phi", 2), None
    ode = ca.vertcat(phi[1], -3 * phi[1] - 8 * ca.sin(phi[0] / 2))
    options = {"reltol": 1e-12, "abstol": 1e-13}
    pendulum = ca.integrator("phi", "cvodes", {"x": phi, "ode": ode}, 0.0, time[1:].tolist(), options)
    angle = pendulum(x0=[np.linalg.norm(axis_angle), 0], p=p or [])["xf"].full()[0]
    wanted = np.outer(angle, axis_angle / np.linalg.norm(axis_angle))
    np.testing.assert_allclose(vectors[1:], wanted, atol=1e-8)


def test_a_held_base_stays_and_its_wrench_is_that_of_the_motion() -> None:
    robot = moving_robot("free", [], controller=HELD)
    recording = simulate(robot, sensors=False)
    speed = columns(recording, robot, "velocity")
    assert np.abs(speed).max() > 0.5  # the arm does move
    place = np.stack([recording[f"base.position.{a}"] for a in "xyz"], axis=1)
    turn = np.stack([recording[f"base.attitude.{a}"] for a in "wxyz"], axis=1)
    assert np.abs(place - place[0]).max() < 1e-7  # 1e-8 a step, and the gains pull back
    assert np.abs(turn - turn[0]).max() < 1e-7
    motion = [columns(recording, robot, name) for name in ("position", "velocity", "acceleration")]
    need = RobotModel(robot).inverse_dynamics(*motion, base=base_of(recording))[:, :6]
    names = [f"base.control_{q}.{a}" for q in ("force", "torque") for a in "xyz"]
    given = np.stack([recording[name] for name in names], axis=1)
    assert np.abs(given).max() > 1.0
    # the angular acceleration of the base, which is no channel, is taken for zero: it is its drift's
    np.testing.assert_allclose(given, need, atol=1e-5)
    momentum = [recording[f"robot.linear_momentum.{a}"] for a in "xyz"]
    assert np.abs(momentum).max() > 0.1  # a wrench from outside changes it


def test_the_reduced_form_keeps_momentum_and_needs_no_wrench() -> None:
    robot = moving_robot("free", [], controller=GAINS)
    recording = simulate(robot, sensors=False)
    for kind, a in itertools.product(("linear", "angular"), "xyz"):
        # from rest: 1e-8 a step of momenta of order one
        assert np.abs(recording[f"robot.{kind}_momentum.{a}"]).max() < 1e-6
    assert not any("control_" in name for name in recording)
    assert command_size(robot) == 3


RAMP = {"joint": "x", "kind": "table", "times": (0, 1, 3, 6), "positions": (0.0, 0.1, 0.3, 0.6)}
RUBBING = [{"effect": "coulomb_friction", "at": "x", "torque": 5.0}]


def test_friction_causes_the_error_of_the_dead_band() -> None:
    """e = T_f / (kp Zbar) at a steady speed: 5 N on 2 kg."""
    robot = axis({**GAINS, "kp": 100.0, "kd": 20.0}, reference=[RAMP], effects=RUBBING, gravity=(0, 0, 0))
    recording = simulate(robot, sensors=False)
    error = recording["x.reference_position"] - recording["x.position"]
    # four seconds after the start of the ramp: exp(-10 * 4) of the transient
    np.testing.assert_allclose(error[-1], 5.0 / (100.0 * 2.0), rtol=1e-6)


def test_feed_forward_of_the_friction_level_removes_the_error() -> None:
    gains = {**GAINS, "kp": 100.0, "kd": 20.0, "coulomb_feedforward": 5.0}
    still = {"gravity": (0, 0, 0)}
    recording = simulate(axis(gains, reference=[RAMP], effects=RUBBING, **still), sensors=False)
    assert abs(recording["x.reference_position"][-1] - recording["x.position"][-1]) < 1e-9
    plain = {"kind": "pd", "kp": 300.0, "kd": 60.0}
    recording = simulate(
        axis({**plain, "coulomb_feedforward": 5.0}, reference=[RAMP], **still), sensors=False
    )
    ahead = recording["x.position"][-1] - recording["x.reference_position"][-1]
    np.testing.assert_allclose(ahead, 5.0 / 300.0, rtol=1e-3)  # without friction it pushes too far


@pytest.mark.parametrize("base", ["fixed", pytest.param("free", marks=pytest.mark.proof)])
def test_feed_forward_of_the_bearing_load_reduces_the_tracking_error(base: str) -> None:
    effects = [
        {"effect": "load_dependent_friction", "at": f"joint{k}", "coefficient": 0.3, "gear_share": 0.0}
        for k in range(3)
    ]

    def worst(**more: float) -> float:
        robot = moving_robot(base, effects, gravity=base == "fixed")
        controller = ComputedTorque(kp=100.0, kd=20.0, **more)
        robot = robot.model_copy(update={"controller": controller})
        recording = simulate(robot, sensors=False)
        error = columns(recording, robot, "position") - columns(recording, robot, "reference_position")
        return float(np.sqrt(np.mean(error**2)))

    # what is left are the instants around reversals at which reference and joint move in opposite directions
    assert worst(load_feedforward=0.3) < 0.1 * worst()


def test_torque_limits_apply_to_computed_torque() -> None:
    free = moving_robot("free", [], controller=HELD)
    data = free.model_dump()
    peak = np.abs(columns(simulate(free, sensors=False), free, "torque")).max(axis=0)
    for joint, largest in zip(data["joints"], peak):
        joint["actuator"]["torque_limit"] = 0.5 * float(largest)
    robot = Robot.model_validate(data)
    torque = np.abs(columns(simulate(robot, sensors=False), robot, "torque"))
    np.testing.assert_array_equal(torque.max(axis=0), 0.5 * peak)


@pytest.mark.proof
def test_a_sampled_controller_of_base_and_joints_converges_to_the_continuous_one() -> None:
    def run(hold: float) -> np.ndarray:
        gains = {**HELD, "sample_time": hold, "coulomb_feedforward": 0.05}
        reference = moving_robot("free", []).reference.model_copy(update={"sample_rate": 50.0})
        robot = moving_robot("free", [], controller=gains, reference=reference.model_dump())
        recording = simulate(robot, sensors=False)
        return np.stack([recording[f"base.position.{a}"] for a in "xyz"] + [recording["joint0.position"]])

    continuous = run(0.0)
    errors = [np.abs(run(hold) - continuous).max() for hold in (0.02, 0.01, 0.005)]
    for larger, smaller in itertools.pairwise(errors):
        assert 1.7 < larger / smaller < 2.4  # a hold delays by half its length: first order
