"""Effects in a simulation, and what sensors make of it."""

from __future__ import annotations

import numpy as np
import pytest
from quick_ones import quick_names
from test_reference_control import axis

from reference_model.simulation import simulate
from robot_model import InputError, Robot, load_robot, shipped_robots

CONTROL = {"kind": "pd", "kp": 4000.0, "kd": 200.0}
WAVE = {"joint": "x", "kind": "multisine", "amplitudes": (0.1,), "frequencies": (0.7,)}


def robot(**more) -> Robot:
    return axis(CONTROL, reference=[WAVE], **more)


def test_only_sensors_are_recorded_with_their_noise_and_resolution() -> None:
    sensors = [
        {"channel": "x.torque", "noise": 0.5},
        {"channel": "x.position", "noise": 1e-4, "resolution": 1e-3},
    ]
    truth = simulate(robot(sensors=sensors), sensors=False)
    measured = simulate(robot(sensors=sensors))
    assert set(measured) == {"x.torque", "x.position", "x.reference_position"}
    assert measured.noise == {"x.torque": 0.5, "x.position": 1e-4}
    assert measured.resolution == {"x.position": 1e-3}
    noise = measured["x.torque"] - truth["x.torque"]
    count = len(noise)
    assert abs(noise.std() / 0.5 - 1) < 5 / np.sqrt(2 * count)  # five standard errors
    assert abs(noise.mean()) < 5 * 0.5 / np.sqrt(count)
    steps = measured["x.position"] / 1e-3
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    # rounding adds 1/12 of a squared step
    error = measured["x.position"] - truth["x.position"]
    assert abs(error.std() / np.hypot(1e-4, 1e-3 / np.sqrt(12)) - 1) < 0.1
    assert abs(error.mean()) < 1e-4  # to the nearest step, not downwards: that would be half a step, 5e-4


def test_noise_of_a_channel_does_not_depend_on_other_sensors() -> None:
    torque, position = {"channel": "x.torque", "noise": 0.5}, {"channel": "x.position", "noise": 1e-4}
    alone, both = (
        simulate(robot(sensors=[torque]), seed=3),
        simulate(robot(sensors=[position, torque]), seed=3),
    )
    np.testing.assert_array_equal(alone["x.torque"], both["x.torque"])


def test_a_robot_without_sensors_records_every_channel() -> None:
    truth, measured = simulate(robot(), sensors=False), simulate(robot())
    assert set(truth) == set(measured)
    for name in truth:
        np.testing.assert_array_equal(truth[name], measured[name])


def test_sensor_effects_change_readings_but_not_the_motion() -> None:
    effect = {"effect": "sensor_offset", "at": "x.position", "offset": 0.25}
    honest, faulty = simulate(robot()), simulate(robot(effects=[effect]))
    np.testing.assert_allclose(faulty["x.position"] - honest["x.position"], 0.25, atol=1e-15)
    np.testing.assert_array_equal(faulty["x.torque"], honest["x.torque"])
    with pytest.raises(InputError, match=r"no sensor measures 'y\.position'.*x\.position"):
        simulate(robot(effects=[{**effect, "at": "y.position"}]))
    with pytest.raises(InputError, match=r"no channel 'x\.temperature"):
        simulate(robot(sensors=[{"channel": "x.temperature.z"}]))


def test_body_effects_change_the_robot_and_not_its_controller() -> None:
    payload = {"effect": "payload", "at": "carriage", "mass": 1.5}
    gravity_fed = {**CONTROL, "gravity_feedforward": True}
    loaded = simulate(axis(gravity_fed, effects=[payload]), sensors=False)
    # the controller holds 2 kg: the other 1.5 kg stretch the position loop
    np.testing.assert_allclose(loaded["x.position"][-1], -1.5 * 9.81 / 4000.0, rtol=1e-6)
    tilt = {"effect": "gravity", "at": "base", "x": 0.0, "y": 0.0, "z": 9.81}
    weightless = simulate(axis(CONTROL, effects=[tilt]), sensors=False)
    assert np.abs(weightless["x.position"]).max() < 1e-12


def test_actuator_effects_act_on_the_commanded_torque() -> None:
    recording = simulate(
        robot(effects=[{"effect": "torque_gain", "at": "x", "gain_error": 0.2}]), sensors=False
    )
    delivered = 2.0 * (recording["x.acceleration"] + 9.81)
    np.testing.assert_allclose(delivered, 1.2 * recording["x.torque"], atol=1e-9)
    assert not np.any(recording["x.friction_torque"])  # no friction law


def test_a_lag_starts_at_the_first_command() -> None:
    lag = {"effect": "actuator_lag", "at": "x", "time_constant": 0.05}
    fed = {**CONTROL, "gravity_feedforward": True}
    still = simulate(axis(fed, effects=[lag]), sensors=False)
    assert np.abs(still["x.position"]).max() < 1e-12  # the weight is held from the first instant
    moving = simulate(axis(fed, reference=[WAVE], effects=[lag]), sensors=False, rtol=1e-10, atol=1e-12)
    delivered = 2.0 * (moving["x.acceleration"] + 9.81)
    slope = np.gradient(delivered, moving.time)[1:-1]
    # central differences over 4 ms of motions below 60 rad/s: (0.12)^2 / 6 of the largest slope
    wanted = (moving["x.torque"] - delivered)[1:-1] / 0.05
    np.testing.assert_allclose(slope, wanted, atol=3e-3 * np.abs(wanted).max())


def test_modifiers_count_as_friction() -> None:
    law = {"effect": "viscous_friction", "at": "x", "coefficient": 30.0}
    cold = {
        "effect": "temperature_dependent_friction",
        "at": "x",
        "rate": 0.02,
        "reference_temperature": 313.15,
    }
    recording = simulate(robot(effects=[law, cold]), sensors=False)
    wanted = -30.0 * np.exp(0.02 * 20.0) * recording["x.velocity"]  # joints are at 20 degrees Celsius
    np.testing.assert_allclose(recording["x.friction_torque"], wanted, atol=1e-9)


def test_a_short_push_at_rest_is_not_skipped_by_the_integrator() -> None:
    push = {"effect": "external_torque", "at": "x", "torque": 50.0, "start": 3.0, "duration": 0.02}
    control = {**CONTROL, "gravity_feedforward": True}
    recording = simulate(axis(control, effects=[push]), sensors=False)
    # an impulse of 1 N s on 2 kg: 0.5 m/s, less what controller and edges take in 20 ms
    assert 0.1 < np.abs(recording["x.velocity"]).max() < 0.5


@pytest.mark.parametrize("name", quick_names(shipped_robots(), "single_axis", "two_link_arm"))
def test_shipped_robots_move_within_their_limits(name: str) -> None:
    robot = load_robot(name)
    recording = simulate(robot, sensors=False)
    for joint in robot.moving_joints:
        position, speed = recording[f"{joint.name}.position"], np.abs(recording[f"{joint.name}.velocity"])
        assert np.ptp(position) > 0.05
        assert np.ptp(recording[f"{joint.name}.torque"]) > 0
        if joint.velocity_limit:
            assert speed.max() < joint.velocity_limit
        if joint.actuator and joint.actuator.torque_limit:
            assert np.abs(recording[f"{joint.name}.torque"]).max() < joint.actuator.torque_limit
