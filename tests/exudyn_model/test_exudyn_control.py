"""Controllers against linear systems solved exactly by the matrix exponential."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from exudyn_robots import cart, joint, pendulum
from scipy.linalg import expm

from exudyn_model import simulate
from robot_model import Actuator, InputError, JointPD, Quintic, Reference, Robot, VoltageServo

MASS = 3.0


def slide(**changes: Any) -> Robot:
    """The cart starting at 0.05 m with 0.4 m/s; the reference holds 0.05 m."""
    actuator = changes.pop("actuator", Actuator())
    start = {"initial_position": 0.05, "initial_velocity": 0.4}
    hinge = joint("slide", kind="prismatic", child="body", axis=(1.0, 0.0, 0.0), actuator=actuator, **start)
    return cart(joints=(hinge,), **changes)


def test_a_sampled_controller_holds_its_output_between_ticks() -> None:
    period, kp, kd = 0.02, 400.0, 25.0
    robot = slide(controller=JointPD(kp=kp, kd=kd, sample_time=period))
    recording = simulate(robot, sensors=False)
    x, expected = np.array([0.0, 0.4]), []
    for _ in range(int(recording.time[-1] / period) + 1):
        expected.append(x.copy())
        acceleration = -(kp * x[0] + kd * x[1]) / MASS
        x = x + np.array([x[1] * period + 0.5 * acceleration * period**2, acceleration * period])
    every = round(period * 200)
    # Constant force over a tick: the trapezoidal rule is exact; a late tick would cost 1e-3.
    np.testing.assert_allclose(
        recording["slide.position"][::every] - 0.05, np.array(expected)[:, 0], atol=1e-9
    )
    np.testing.assert_allclose(recording["slide.velocity"][::every], np.array(expected)[:, 1], atol=1e-8)


def test_integral_action_is_that_of_a_third_order_system() -> None:
    kp, kd, ki = 200.0, 30.0, 500.0
    recording = simulate(slide(controller=JointPD(kp=kp, kd=kd, ki=ki)), sensors=False)
    # States: minus the integral of the error, deviation, velocity.
    matrix = np.array([[0, 1, 0], [0, 0, 1], [-ki / MASS, -kp / MASS, -kd / MASS]])
    expected = np.array([expm(matrix * t) @ [0.0, 0.0, 0.4] for t in recording.time])
    # h^2/12 of the third derivative (4 m/s^3 per 0.1 s): about 1e-7 m.
    np.testing.assert_allclose(recording["slide.position"] - 0.05, expected[:, 1], atol=5e-7)


def test_a_voltage_servo_has_back_emf() -> None:
    actuator = Actuator(gear_ratio=10.0, torque_constant=0.2, resistance=2.0)
    robot = slide(actuator=actuator, controller=VoltageServo(gain=2.0, supply=12.0))
    recording = simulate(robot, sensors=False)
    k, resistance = 10.0 * 0.2, 2.0
    stiffness, damping = k / resistance * 2.0 * 12.0, k * k / resistance
    matrix = np.array([[0, 1], [-stiffness / MASS, -damping / MASS]])
    expected = np.array([expm(matrix * t) @ [0.0, 0.4] for t in recording.time])
    np.testing.assert_allclose(recording["slide.position"] - 0.05, expected[:, 0], atol=5e-7)  # as above
    voltage = recording["slide.voltage"]
    np.testing.assert_allclose(
        voltage, -24.0 * expected[:, 0], atol=2e-5
    )  # 24 V/m times the position's error
    emf = k * recording["slide.velocity"]
    np.testing.assert_allclose(recording["slide.current"], (voltage - emf) / resistance, atol=1e-9)


def test_a_servo_saturates_at_its_supply() -> None:
    actuator = Actuator(gear_ratio=10.0, torque_constant=0.2, resistance=2.0)
    far = (Quintic(joint="slide", displacement=50.0, duration=1e-3),)
    robot = slide(
        actuator=actuator,
        controller=VoltageServo(gain=2.0, supply=12.0),
        reference=Reference(duration=1.0, sample_rate=200.0, joints=far),
    )
    voltage = simulate(robot, sensors=False)["slide.voltage"]
    assert np.all(voltage[1:] == 12.0)


def test_the_actuator_limit_clips_the_command() -> None:
    far = (Quintic(joint="slide", displacement=50.0, duration=1e-3),)
    robot = slide(
        actuator=Actuator(torque_limit=6.0),
        controller=JointPD(kp=1e4),
        reference=Reference(duration=1.0, sample_rate=200.0, joints=far),
    )
    recording = simulate(robot, sensors=False)
    assert recording["slide.torque"].max() == 6.0
    time = recording.time
    # From 0.01 s on the force is constant; before, the smooth start of the reference costs a little time.
    speed_gained = recording["slide.velocity"] - recording["slide.velocity"][2]
    np.testing.assert_allclose(speed_gained[2:], 2.0 * (time - time[2])[2:], atol=1e-9)


def test_gravity_feedforward_holds_the_arm_where_it_is() -> None:
    start = joint("hinge", axis=(0.0, 1.0, 0.0), initial_position=0.7)
    robot = pendulum(joints=(start,), controller=JointPD(kp=1.0, gravity_feedforward=True))
    recording = simulate(robot, sensors=False)
    np.testing.assert_allclose(recording["hinge.position"], 0.7, atol=1e-9)  # Newton tolerance
    np.testing.assert_allclose(recording["hinge.torque"], 2.0 * 9.81 * 0.5 * np.sin(0.7), atol=1e-8)


def test_a_passive_joint_gets_no_torque() -> None:
    robot = slide(actuator=None, controller=JointPD(kp=100.0))
    assert not simulate(robot, sensors=False)["slide.torque"].any()


def test_a_servo_needs_motor_data() -> None:
    with pytest.raises(InputError, match=r"joint 'slide' needs actuator\.torque_constant"):
        simulate(slide(controller=VoltageServo(gain=1.0, supply=12.0)))


def test_a_diverging_motion_is_refused_with_time_and_state() -> None:
    robot = slide(controller=JointPD(kp=-1e6, kd=0.0), reference=Reference(duration=5.0, sample_rate=100.0))
    with pytest.raises(InputError, match=r"diverges after 0\.0\d+ s \(slide at .* moving"):
        simulate(robot)


def test_a_robot_without_reference_is_refused() -> None:
    with pytest.raises(InputError, match=r"has no \[reference\]"):
        simulate(slide(reference=None))
