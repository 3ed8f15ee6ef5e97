"""Expected behaviour of controllers, drives and reference motions."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from test_reference_simulation import base_of, columns, moving_robot

from reference_model.codegen.batched import Batched
from reference_model.control.motion import reference_function
from reference_model.evaluation.model import RobotModel
from reference_model.simulation import simulate
from robot_model import InputError, Robot


def axis(controller: dict, *, reference: list[dict] | None = None, **more) -> Robot:
    """A 2 kg carriage on a rail that points up, in gravity."""
    actuator = {"gear_ratio": 50.0, "torque_constant": 0.04, "resistance": 2.0, **more.pop("actuator", {})}
    joint = {"name": "x", "kind": "prismatic", "parent": "base", "child": "carriage", "actuator": actuator}
    return Robot.model_validate(
        {
            "name": "axis",
            "gravity": (0.0, 0.0, -9.81),
            "links": [{"name": "carriage", "mass": 2.0}],
            "joints": [joint],
            "controller": controller,
            "reference": {"duration": 4.0, "sample_rate": 500.0, "joints": reference or []},
            **more,
        }
    )


def test_a_pd_controlled_axis_is_a_damped_oscillator() -> None:
    kp, kd = 80.0, 10.0
    recording = simulate(axis({"kind": "pd", "kp": kp, "kd": kd}), sensors=False, rtol=1e-10, atol=1e-12)
    t, rest = recording.time, -2.0 * 9.81 / kp
    decay, w = kd / 4.0, np.sqrt(kp / 2.0 - (kd / 4.0) ** 2)
    wanted = rest * (1 - np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t)))
    # the global error of some hundred steps at 1e-10
    np.testing.assert_allclose(recording["x.position"], wanted, atol=1e-7)


def test_gravity_feed_forward_and_integral_action_hold_the_weight() -> None:
    gains = {"kind": "pd", "kp": 400.0, "kd": 60.0}
    fed = simulate(axis({**gains, "gravity_feedforward": True}), sensors=False)
    assert np.abs(fed["x.position"]).max() < 1e-12  # in balance from the start
    integral = simulate(axis({**gains, "ki": 2000.0}), sensors=False)
    assert np.abs(integral["x.position"]).max() > 1e-3  # it sinks first
    assert abs(integral["x.position"][-1]) < 1e-5  # the slowest of its three poles is at -7 / s: exp(-28)


def test_a_drive_limits_the_torque() -> None:
    recording = simulate(axis({"kind": "pd", "kp": 400.0}, actuator={"torque_limit": 15.0}), sensors=False)
    assert recording["x.torque"].max() == 15.0
    # 15 N against 19.62 N of weight: it falls at last with a constant acceleration
    np.testing.assert_allclose(recording["x.acceleration"][-1], 15.0 / 2 - 9.81, rtol=1e-12)


def test_voltage_servo_and_its_back_emf() -> None:
    wave = {"joint": "x", "kind": "multisine", "amplitudes": (0.02,), "frequencies": (1.0,)}
    servo = {"kind": "voltage_servo", "gain": 30.0, "supply": 24.0}
    recording = simulate(axis(servo, reference=[wave]), sensors=False)
    constant = 50.0 * 0.04
    error = recording["x.reference_position"] - recording["x.position"]
    voltage = 24.0 * np.clip(30.0 * error, -1, 1)
    np.testing.assert_allclose(recording["x.voltage"], voltage, atol=1e-12)
    current = (voltage - constant * recording["x.velocity"]) / 2.0
    np.testing.assert_allclose(recording["x.current"], current, atol=1e-12)
    np.testing.assert_allclose(recording["x.torque"], constant * current, atol=1e-12)
    with pytest.raises(InputError, match="resistance"):
        simulate(axis(servo, actuator={"resistance": None}))


def test_a_passive_joint_gets_no_torque() -> None:
    data = axis({"kind": "pd", "kp": 400.0}).model_dump()
    data["joints"][0]["actuator"] = None
    recording = simulate(Robot.model_validate(data), sensors=False)
    assert not np.any(recording["x.torque"])
    # free fall for 4 s at a relative tolerance of 1e-8
    np.testing.assert_allclose(recording["x.position"][-1], -9.81 * 8, rtol=1e-6)


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_computed_torque_tracks_exactly_with_a_perfect_model(base: str) -> None:
    controller = {"kind": "computed_torque", "kp": 100.0, "kd": 20.0}
    robot = moving_robot(base, [], gravity=True, controller=controller)
    recording = simulate(robot, sensors=False)
    error = columns(recording, robot, "position") - columns(recording, robot, "reference_position")
    assert np.abs(error).max() < 1e-6  # the integration's tolerance, 1e-8 a step


def test_computed_torque_on_a_free_base_applies_only_joint_torques() -> None:
    controller = {"kind": "computed_torque", "kp": 100.0, "kd": 20.0}
    robot = moving_robot("free", [], controller=controller)
    recording = simulate(robot, sensors=False)
    motion = [columns(recording, robot, name) for name in ("position", "velocity")]
    found = RobotModel(robot).forward_dynamics(
        *motion, columns(recording, robot, "torque"), base=base_of(recording)
    )
    np.testing.assert_allclose(found[:, 6:], columns(recording, robot, "acceleration"), atol=1e-9)  # rounding


def test_a_sampled_controller_holds_and_converges_to_the_continuous_one() -> None:
    def run(hold: float) -> tuple[np.ndarray, np.ndarray]:
        gains = {"kind": "pd", "kp": 200.0, "kd": 30.0, "sample_time": hold}
        recording = simulate(axis(gains), sensors=False)
        return recording["x.position"], recording["x.torque"]

    continuous = run(0.0)[0]
    coarse, torque = run(0.02)  # output every 2 ms
    assert np.all(torque[:-1].reshape(-1, 10) == torque[:-1:10, None])
    errors = [np.abs(position - continuous).max() for position in (coarse, run(0.01)[0], run(0.005)[0])]
    for larger, smaller in itertools.pairwise(errors):
        assert 1.7 < larger / smaller < 2.6  # a hold delays by half its length: first order


def test_sampling_instants_between_the_samples_of_the_recording() -> None:
    gains = {"kind": "pd", "kp": 200.0, "kd": 30.0, "sample_time": 0.007}
    recording = simulate(axis(gains), sensors=False)
    moving = recording.window(0.0, 3.0)  # later it has settled to the last digit
    changes = moving.time[1:][np.diff(moving["x.torque"]) != 0]
    instants = np.arange(1, 572) * 0.007
    wanted = np.unique(np.ceil(instants * 500 - 1e-6)) / 500  # each shows at the next sample
    np.testing.assert_allclose(changes, wanted[: len(changes)], atol=1e-9)


def test_reference_motions_match_their_formulas() -> None:
    times = np.linspace(-0.5, 4.5, 1001)
    table = {"kind": "table", "times": (0.5, 1.0, 2.0, 3.5), "positions": (0.1, 0.4, -0.2, 0.3)}
    waves = {"kind": "multisine", "amplitudes": (0.3, 0.1), "frequencies": (0.5, 1.2), "phases": (0.2, 1.0)}
    quintic = {"kind": "quintic", "displacement": 2.0, "start": 1.0, "duration": 2.0}
    cycloid = {"kind": "cycloid", "displacement": -1.0, "start": 1.0, "duration": 2.0}
    # six instants with a polynomial of degree 5 through them: the spline is that polynomial
    knots, coefficients = np.array([0.2, 1.0, 1.7, 2.1, 3.5, 4.2]), (0.1, 0.5, -0.4, 0.3, -0.1, 0.01)
    places = tuple(np.polynomial.Polynomial(coefficients)(knots))
    smooth = {"kind": "table", "times": tuple(knots), "positions": places, "degree": 5}
    s = np.clip((times - 1) / 2, 0, 1)
    fade = np.clip(times, None, 1)
    fade = 10 * fade**3 - 15 * fade**4 + 6 * fade**5
    angles = [2 * np.pi * f * times + p for f, p in ((0.5, 0.2), (1.2, 1.0))]
    wanted = {
        "hold": 0 * times,
        "quintic": 2 * (10 * s**3 - 15 * s**4 + 6 * s**5),
        "cycloid": -(s - np.sin(2 * np.pi * s) / (2 * np.pi)),
        "multisine": fade * (0.3 * np.sin(angles[0]) + 0.1 * np.sin(angles[1])),
        "table": CubicSpline(table["times"], table["positions"])(np.clip(times, 0.5, 3.5)),
        "polynomial": np.polynomial.Polynomial(coefficients)(np.clip(times, 0.2, 4.2)),
    }
    for item in ({"kind": "hold"}, quintic, cycloid, waves, table, smooth):
        robot = axis({"kind": "none"}, reference=[{"joint": "x", **item}])
        values = Batched(reference_function(robot))(times[:, None])
        # a hundred operations on numbers of order one
        kind = "polynomial" if "degree" in item else item["kind"]
        np.testing.assert_allclose(values[0][:, 0], wanted[kind], atol=1e-13)
        inner = slice(300, 600)  # 1.0 to 2.5 s, inside all of them and away from their ends
        for order in (0, 1):
            slope = np.gradient(values[order][inner, 0], times[inner])[1:-1]
            # central differences over 5 ms of motions below 8 rad/s: (0.04)^2 / 6 of the derivative
            np.testing.assert_allclose(slope, values[order + 1][inner, 0][1:-1], atol=2e-2)


def test_a_table_drives_a_simulation() -> None:
    table = {"joint": "x", "kind": "table", "times": (0, 1, 2, 3, 4), "positions": (0, 0.1, 0, -0.1, 0)}
    controller = {"kind": "computed_torque", "kp": 400.0, "kd": 40.0}
    for hold in (0.0, 0.002):
        recording = simulate(axis({**controller, "sample_time": hold}, reference=[table]), sensors=False)
        late = recording.time > 1.0  # the spline starts with a velocity that the carriage has not
        error = recording["x.position"] - recording["x.reference_position"]
        assert np.abs(error[late]).max() < (1e-6 if hold == 0 else 1e-3)
