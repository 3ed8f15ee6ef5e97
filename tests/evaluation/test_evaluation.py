"""Residuals of a robot file on a recording: none for the true robot, else those of the missing physics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import minimum_filter1d

from missing_physics.evaluation import Band, evaluate
from reference_model.codegen.compiled import SWITCH
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, Link, Recording, Robot, load_robot

BAND = Band(torque=20.0, motion=60.0)


@pytest.fixture(autouse=True)
def _compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SWITCH, "on")


def shortened(name: str, *, duration: float = 3.0, rate: float = 500.0) -> Robot:
    """A shipped robot without effects and without noise of its sensors."""
    robot = load_robot(name)
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": duration, "sample_rate": rate})
    sensors = tuple(s.model_copy(update={"noise": 0.0, "resolution": 0.0}) for s in robot.sensors)
    return robot.model_copy(update={"reference": reference, "sensors": sensors, "effects": ()})


ARM = shortened("two_link_arm")
#: Until then what the controller's first torque shakes, faster than the band, is not settled [s].
SETTLED = 0.5


def left_by(robot: Robot, recording: Recording) -> dict[str, float]:
    """rms of the residual by channel after the start."""
    found = evaluate(robot, recording, BAND)
    instants = found.time[found.time > SETTLED]
    return {c: float(np.sqrt(np.mean(found.at(instants, c) ** 2))) for c in found.rms()}


EFFECTS = [
    EffectUse(effect="viscous_friction", at="joint1", coefficient=1.5),
    EffectUse(effect="cable_spring", at="joint2", stiffness=4.0, torque_at_zero=1.0),
    EffectUse(effect="torque_offset", at="joint1", torque=0.7),
    EffectUse(effect="torque_gain", at="joint2", gain_error=0.1),
    EffectUse(effect="actuator_lag", at="joint1", time_constant=0.01),
    EffectUse(effect="payload", at="link2", mass=0.6, x=0.4, y=0.0, z=0.0),
    EffectUse(effect="gravity", at="base", x=0.3, y=0.0, z=0.2),
    EffectUse(effect="sensor_gain", at="joint2.position", gain_error=0.03),
    EffectUse(effect="sensor_delay", at="joint1.position", delay=0.004),
    EffectUse(effect="sensor_gain", at="joint1.torque", gain_error=-0.05),
    EffectUse(effect="sensor_delay", at="joint2.torque", delay=0.004),
    EffectUse(effect="clock_drift", at="joint1.torque", rate=2e-3),
]


@pytest.mark.parametrize("use", EFFECTS, ids=lambda use: f"{use.effect}@{use.at}")
def test_true_robot_leaves_no_residual(use: EffectUse) -> None:
    real = ARM.with_effects(use)
    recording = simulate(real, seed=0)
    left, nominal = (left_by(robot, recording) for robot in (real, ARM))
    # filtered alike; what a recording of 500 Hz does not hold of the motion is hundredths of what is missing
    shows = max(nominal, key=lambda channel: nominal[channel])
    assert left[shows] < 0.03 * nominal[shows]


@pytest.mark.parametrize("effect", ["coulomb_friction", "stribeck_friction", "lugre_friction"])
def test_samples_with_uncertain_dry_friction_are_excluded_only_at_reversals(effect: str) -> None:
    """Where the encoder does not tell the sign of a velocity no more than a part of the law shows."""
    numbers = {
        "coulomb_friction": {"torque": 3.0},
        "stribeck_friction": {"coulomb_torque": 2.0, "static_torque": 3.0, "stribeck_velocity": 0.1},
        "lugre_friction": {
            "coulomb_torque": 2.0,
            "static_torque": 2.5,
            "stribeck_velocity": 0.1,
            "bristle_stiffness": 5000.0,
            "bristle_damping": 20.0,
        },
    }[effect]
    real = ARM.with_effects(EffectUse(effect=effect, at="joint1", **numbers))
    recording = simulate(real, seed=0)
    left, nominal = (evaluate(robot, recording, BAND).rms()["joint1.torque"] for robot in (real, ARM))
    assert left < 0.1 * nominal


def test_load_dependent_friction_uses_the_loads_including_the_payload() -> None:
    robot = shortened("flexible_space_robot_planar")
    sensors = tuple(s for s in robot.sensors if not s.channel.startswith("link2"))
    links = tuple(_rigid(link) for link in robot.links)
    arm = robot.model_copy(update={"links": links, "sensors": sensors})
    assert arm.moving_joints[1].bearing is not None
    heavy = EffectUse(effect="payload", at="link2", mass=2.0, x=0.5)
    viscous = EffectUse(effect="viscous_friction", at="joint2", coefficient=3.0)
    loaded = EffectUse(effect="load_dependent_friction", at="joint2", coefficient=0.3, gear_share=0.0)
    real = arm.with_effects(heavy, viscous, loaded)
    recording = simulate(real, seed=0)
    left, without = (
        evaluate(robot, recording, BAND).rms()["joint2.torque"]
        for robot in (real, arm.with_effects(heavy, viscous))
    )
    assert left < 0.1 * without


def _rigid(link: Link) -> Link:
    if link.beam is None:
        return link
    solid = {"mass": 3.0, "center_of_mass": (0.5, 0.0, 0.0), "inertia": (0.01, 0.3, 0.3), "beam": None}
    return link.model_copy(update=solid)


def test_attitude_of_a_free_base_follows_the_gyro_for_any_bias() -> None:
    robot = shortened("six_joint_space_arm", duration=2.0)
    made = simulate(robot, seed=0)
    biased = made.with_channels({"base.angular_velocity.x": made["base.angular_velocity.x"] + 0.1})
    found = evaluate(robot, biased, BAND)
    assert found.channels[-3:] == tuple(f"base.angular_velocity.{axis}" for axis in "xyz")
    recorded = dict(zip(found.channels, np.sqrt(np.mean(found.measured**2, axis=0))))
    assert all(rms < 1e-3 * recorded[channel] for channel, rms in found.rms().items())
    lighter = robot.model_copy(update={"base": robot.base.model_copy(update={"mass": 0.5 * robot.base.mass})})
    wrong = evaluate(lighter, biased, BAND).rms()
    assert wrong["base.angular_velocity.z"] > 0.01 * recorded["base.angular_velocity.z"]


def test_wrong_mass_leaves_its_weight_and_inertial_force() -> None:
    axis = shortened("single_axis")
    made = simulate(axis, sensors=False)
    heavier = axis.links[0].model_copy(update={"mass": axis.links[0].mass + 2.0})
    wrong = axis.model_copy(update={"links": (heavier,), "gravity": (9.81, 0.0, 0.0)})
    true = axis.model_copy(update={"gravity": (9.81, 0.0, 0.0)})
    found, exact = (evaluate(robot, made, BAND) for robot in (wrong, true))
    name = axis.moving_joints[0].name
    acceleration = np.interp(found.time, made.time, made[f"{name}.acceleration"])
    speed = np.abs(np.interp(found.time, made.time, made[f"{name}.velocity"]))
    # Away from rests, about which nothing is compared, by more than what the band's filter spreads.
    sliding = minimum_filter1d(speed, int(0.5 * found.time.size / np.ptp(found.time) / BAND.torque)) > 0.1
    assert sliding[found.time > SETTLED].mean() > 0.05
    settled = sliding & (found.time > SETTLED)
    more = (found.residual - exact.residual)[settled, 0]
    # gravity pulls along the rail; the band is twenty times as wide as the motion
    np.testing.assert_allclose(more, 2.0 * (9.81 - acceleration[settled]), atol=1e-2)
    assert found.units == ("N",)


def test_torque_is_computed_from_a_current_or_a_voltage() -> None:
    motors = tuple(
        joint.model_copy(
            update={
                "actuator": joint.actuator.model_copy(update={"torque_constant": 0.05, "resistance": 1.5})
            }
        )
        for joint in ARM.joints
        if joint.actuator is not None
    )
    robot = ARM.model_copy(update={"joints": motors})
    made = simulate(robot, sensors=False)
    position = {name: made[name] for name in made if name.endswith(".position")}
    current, voltage = dict(position), dict(position)
    for joint in robot.moving_joints:
        assert joint.actuator is not None
        constant = joint.actuator.gear_ratio * 0.05
        current[f"{joint.name}.current"] = made[f"{joint.name}.torque"] / constant
        volts = 1.5 * made[f"{joint.name}.torque"] / constant + constant * made[f"{joint.name}.velocity"]
        voltage[f"{joint.name}.voltage"] = volts
    for channels in (current, voltage):
        left = left_by(robot, Recording(made.time, channels, "made"))
        assert left["joint1.torque"] < 1e-3 * np.sqrt(np.mean(made["joint1.torque"] ** 2))


def test_rotor_accelerates_as_measured_by_the_motor_encoder() -> None:
    robot = shortened("two_link_arm")
    rotors = tuple(
        joint.model_copy(
            update={
                "actuator": joint.actuator.model_copy(
                    update={"rotor_inertia": 0.05 / joint.actuator.gear_ratio**2}
                )
            }
        )
        for joint in robot.joints
        if joint.actuator is not None
    )
    soft = EffectUse(effect="joint_elasticity", at="joint2", stiffness=500.0, damping=1.0)
    real = robot.model_copy(update={"joints": rotors}).with_effects(soft)
    made = simulate(real, sensors=False)
    assert "joint2.motor_position" in made
    found = left_by(real, made)["joint2.torque"]
    assert found < 1e-3 * np.sqrt(np.mean(made["joint2.torque"] ** 2))


def test_longest_part_without_a_gap_is_evaluated() -> None:
    made = simulate(ARM, seed=0)
    torque = made["joint1.torque"].copy()
    torque[400:500] = np.nan
    holed = made.with_channels({"joint1.torque": torque})
    found = evaluate(ARM, holed, BAND)
    assert found.time[0] >= made.time[500]
    assert found.rms()["joint1.torque"] < 1e-3 * np.sqrt(np.nanmean(torque**2))


def test_unevenly_sampled_positions_are_resampled() -> None:
    made = simulate(ARM, seed=0)
    chosen = np.sort(np.random.default_rng(3).choice(len(made), size=int(0.9 * len(made)), replace=False))
    thinned = Recording(made.time[chosen], {name: made[name][chosen] for name in made}, "thinned")
    found = evaluate(ARM, thinned, BAND).rms()["joint1.torque"]
    assert found < 1e-2 * np.sqrt(np.mean(made["joint1.torque"] ** 2))


def test_unknown_torque_is_not_compared() -> None:
    made = simulate(ARM, seed=0)
    without = Recording(made.time, {n: made[n] for n in made if n != "joint2.torque"}, "without")
    assert set(evaluate(ARM, without, BAND).rms()) == {"joint1.torque"}


def test_joint_without_recorded_position_is_reported() -> None:
    made = simulate(ARM, seed=0)
    blind = replace(made, channels={n: made[n] for n in made if n != "joint2.position"}, source="blind.csv")
    with pytest.raises(InputError, match=r"blind.csv has neither joint2.position nor joint2.motor_position"):
        evaluate(ARM, blind, BAND)
