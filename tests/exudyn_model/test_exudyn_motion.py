"""Motions known in closed form, and conserved quantities."""

from __future__ import annotations

import numpy as np
import pytest
from exudyn_robots import GRAVITY, cart, joint, pendulum, tumbling_robot
from scipy.special import ellipj, ellipk

from exudyn_model import simulate
from exudyn_model.control.motion import motions
from exudyn_model.solve import system
from reference_model.codegen.batched import Batched
from reference_model.control.motion import reference_function
from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from robot_model import Actuator, Base, ComputedTorque, Cycloid, JointPD, Recording, Reference, Robot, Table


def test_a_free_base_is_in_free_fall() -> None:
    robot = pendulum(base=Base(kind="free", mass=5.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0)))
    recording = simulate(robot, sensors=False, step=5e-4)
    fallen = 3.0 - 0.5 * 9.81 * recording.time**2
    # The trapezoidal rule is exact for constant acceleration; what is left is the Newton tolerance.
    np.testing.assert_allclose(recording["base.position.z"], fallen, atol=1e-9)
    np.testing.assert_allclose(recording["hinge.position"], 0.0, atol=1e-9)


def pendulum_angle(time: np.ndarray, *, start: float, frequency: float) -> np.ndarray:
    """theta = 2 asin(k sn(K - w t)), the undamped pendulum released at `start` (Landau, Lifshitz)."""
    k = np.sin(start / 2)
    sn = ellipj(ellipk(k**2) - frequency * time, k**2)[0]
    return 2 * np.arcsin(k * sn)


@pytest.mark.parametrize("start", [0.1, 2.5])
def test_a_pendulum_swings_by_elliptic_functions(start: float) -> None:
    robot = pendulum(joints=(joint("hinge", axis=(0.0, 1.0, 0.0), initial_position=start, actuator=None),))
    recording = simulate(robot, sensors=False, step=5e-4)
    frequency = np.sqrt(2.0 * 9.81 * 0.5 / (0.1 + 2.0 * 0.5**2))
    expected = pendulum_angle(recording.time, start=start, frequency=frequency)
    # h^2/12 w^2 (w t) angle = 5e-4^2/12 * 16 * 4 * 2.5: 3e-6 rad at most; found 1e-6.
    np.testing.assert_allclose(recording["hinge.position"], expected, atol=3e-6)


def test_the_error_decreases_with_the_square_of_the_step() -> None:
    robot = pendulum(joints=(joint("hinge", axis=(0.0, 1.0, 0.0), initial_position=1.0, actuator=None),))
    frequency = np.sqrt(2.0 * 9.81 * 0.5 / (0.1 + 2.0 * 0.5**2))
    errors = []
    for step in (5e-4, 2.5e-4):
        recording = simulate(robot, sensors=False, step=step)
        expected = pendulum_angle(recording.time, start=1.0, frequency=frequency)
        errors.append(np.abs(recording["hinge.position"] - expected).max())
    order = np.log2(errors[0] / errors[1])
    assert order == pytest.approx(2.0, abs=0.1)  # the next term of the expansion is of relative size h^2


def test_rotor_inertia_and_gains_give_the_damped_oscillation() -> None:
    actuator = Actuator(gear_ratio=20.0, rotor_inertia=5e-3)
    robot = cart(
        joints=(
            joint(
                "slide",
                kind="prismatic",
                child="body",
                axis=(1.0, 0.0, 0.0),
                initial_velocity=0.8,
                actuator=actuator,
            ),
        ),
        controller=JointPD(kp=300.0, kd=6.0),
    )
    mass = 3.0 + 20.0**2 * 5e-3
    decay, undamped = 6.0 / (2 * mass), np.sqrt(300.0 / mass)
    damped = np.sqrt(undamped**2 - decay**2)
    recording = simulate(robot, sensors=False, step=5e-4)
    time = recording.time
    expected = 0.8 / damped * np.exp(-decay * time) * np.sin(damped * time)
    # h^2/12 w^3 t amplitude = 2e-8 * 460 * 0.1 = 1e-6 m.
    np.testing.assert_allclose(recording["slide.position"], expected, atol=1e-6)
    np.testing.assert_allclose(
        recording["slide.torque"],
        -300.0 * recording["slide.position"] - 6.0 * recording["slide.velocity"],
        atol=1e-9,  # the same numbers, added in another order
    )


def test_a_pendulum_conserves_energy() -> None:
    robot = pendulum(joints=(joint("hinge", axis=(0.0, 1.0, 0.0), initial_position=2.0, actuator=None),))
    recording = simulate(robot, sensors=False, step=5e-4)
    angle, rate = recording["hinge.position"], recording["hinge.velocity"]
    energy = 0.5 * (0.1 + 2.0 * 0.25) * rate**2 - 2.0 * 9.81 * 0.5 * np.cos(angle)
    # The velocity is right to about 1e-6 rad/s, at 5 rad/s and 0.6 kg m^2: 3e-6 J; found 2e-6 J.
    np.testing.assert_allclose(energy, energy[0], atol=1e-5)


def base_motion(recording: Recording) -> BaseMotion:
    """Motion of a free base for the reference model; accelerations do not influence momentum."""
    attitude = np.stack([recording[f"base.attitude.{axis}"] for axis in "wxyz"], axis=1)
    angular, linear = (
        np.stack([recording[f"base.{name}.{axis}"] for axis in "xyz"], axis=1)
        for name in ("angular_velocity", "linear_velocity")
    )
    still = np.zeros_like(linear)
    return BaseMotion(attitude, angular, linear, still, still)


def in_order(robot: Robot, recording: Recording, quantity: str) -> np.ndarray:
    """A quantity of all moving joints, shape (N, n)."""
    return np.stack([recording[f"{joint.name}.{quantity}"] for joint in robot.moving_joints], axis=1)


def momentum_drift(robot: Robot, *, step: float) -> float:
    """Largest change of linear [N s] or angular [N m s] momentum over a run."""
    recording = simulate(robot, sensors=False, step=step)
    found = RobotModel(robot).momentum(
        in_order(robot, recording, "position"),
        in_order(robot, recording, "velocity"),
        base=base_motion(recording),
    )
    return max(float(np.abs(rows - rows[0]).max()) for rows in found)


def test_a_floating_robot_conserves_momentum() -> None:
    robot = tumbling_robot(reference=Reference(duration=0.5, sample_rate=100.0))
    coarse, fine = (momentum_drift(robot, step=step) for step in (5e-4, 2.5e-4))
    # Momenta are of the order 20. The trapezoidal rule does not conserve them exactly in these
    # coordinates, but to second order: a quarter of the drift at half the step.
    assert coarse < 1e-5
    assert fine < 0.35 * coarse


def test_a_new_anchor_of_the_base_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = tumbling_robot()
    smooth = simulate(robot, sensors=False)
    assert np.ptp(smooth["base.attitude.y"]) > 0.1  # it does turn
    monkeypatch.setattr(system, "ANCHOR_RANGE", 0.02)
    anchored = simulate(robot, sensors=False)
    for channel in smooth:
        # Both are right to about 1e-7; accelerations to ten times that.
        np.testing.assert_allclose(anchored[channel], smooth[channel], atol=5e-6, err_msg=channel)


def test_computed_torque_tracks_exactly_even_on_a_free_base() -> None:
    """Exudyn's dynamics and the controller's own inverse dynamics cancel."""
    items = tuple(
        Cycloid(joint=name, displacement=distance, duration=0.8)
        for name, distance in (("elbow", 0.9), ("shoulder", -0.7), ("slide", 0.2))
    )
    still = tuple(item.model_copy(update={"initial_velocity": 0.0}) for item in tumbling_robot().joints)
    for base in (tumbling_robot().base, Base(rpy=(0.3, 0.2, 0.1))):
        robot = tumbling_robot(
            base=base,
            gravity=GRAVITY,
            joints=still,
            controller=ComputedTorque(kp=100.0, kd=20.0),
            reference=Reference(duration=1.0, sample_rate=100.0, joints=items),
        )
        recording = simulate(robot, sensors=False, step=1e-3)
        for name in ("elbow", "shoulder", "slide"):
            # Only the discretisation drives the error: h^2/12 of the fourth derivative over kp, below 1e-6.
            np.testing.assert_allclose(
                recording[f"{name}.position"],
                recording[f"{name}.reference_position"],
                atol=2e-6,
                err_msg=name,
            )


@pytest.mark.parametrize("degree", [3, 5])
def test_tables_are_the_same_in_both_engines(degree: int) -> None:
    """Each evaluates the spline in its own way."""
    chance = np.random.default_rng(degree)
    instants = np.cumsum(chance.uniform(0.1, 0.6, 9)) - 0.3
    table = Table(joint="slide", times=tuple(instants), positions=tuple(chance.normal(size=9)), degree=degree)
    robot = tumbling_robot(reference=Reference(duration=1.0, sample_rate=100.0, joints=(table,)))
    which = [joint.name for joint in robot.moving_joints].index("slide")
    times = np.r_[np.linspace(-1.0, instants[-1] + 1.0, 500), instants]
    here = np.array([motions(robot)[which](time) for time in times])
    there = np.stack(
        [order[:, which] for order in Batched(reference_function(robot))(times[:, None])], axis=1
    )
    # rounding in pieces of a tenth of a second, whose second derivatives are of order 1e3
    np.testing.assert_allclose(here, there, atol=1e-9)
