"""Channels against the robot's dynamics: every corruption is reported, and no hidden effect is."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from missing_physics.diagnosis import (
    ContradictionError,
    Options,
    contradictions,
    diagnose,
    make_dynamics,
)
from missing_physics.recordings import Finding, corrected, mapping_from_toml
from reference_model.evaluation.model import RobotModel
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, load_robot

SHIPPED = {
    "single_axis": (12.0, 500.0),
    "two_link_arm": (12.0, 250.0),
    "six_joint_space_arm": (12.0, 100.0),
    "flexible_space_robot": (20.0, 50.0),
    "flexible_space_robot_planar": (20.0, 50.0),
}
DEGREES = 180.0 / np.pi
#: Its planar version is as much of a test, in half of the time.
SPATIAL = "flexible_space_robot"


def param(*values: object) -> object:
    """Values for a robot, the first of them; a proof where there is a quicker one like it."""
    return pytest.param(*values, marks=pytest.mark.proof if values[0] == SPATIAL else ())


every_robot = pytest.mark.parametrize("name", list(map(param, SHIPPED)))


def wrong_torques() -> Iterator[tuple[str, float | str]]:
    """Robot and factor: the motor's side where there is a gear; half for robots whose runs are long."""
    for name in SHIPPED:
        slow = name.startswith("flexible")
        yield name, -1.0
        if not slow:
            yield name, 1000.0
        actuator = load_robot(name).moving_joints[0].actuator
        if actuator is not None and actuator.gear_ratio != 1.0:
            yield name, "motor"
            if not slow:
                yield name, "minus motor"


WRONG_TORQUES = tuple(wrong_torques())


@cache
def robot_of(name: str) -> Robot:
    """The shipped robot with a shorter or coarser recording."""
    robot = load_robot(name)
    assert robot.reference is not None
    duration, rate = SHIPPED[name]
    reference = robot.reference.model_copy(update={"duration": duration, "sample_rate": rate})
    return robot.model_copy(update={"reference": reference})


@cache
def clean(name: str) -> Recording:
    return simulate(robot_of(name), seed=10140)


def without(recording: Recording, *endings: str) -> Recording:
    kept = {c: recording[c] for c in recording if not c.endswith(endings)}
    return replace(recording, channels=kept)


def found(robot: Robot, recording: Recording) -> tuple[Finding, ...]:
    (dynamics,) = make_dynamics(robot, [recording])
    return contradictions(robot, recording, dynamics)


def factors(recording: Recording, **by: float) -> Recording:
    """Channels (`__` for the dot) times a factor."""
    named = {name.replace("__", "."): factor for name, factor in by.items()}
    return recording.with_channels({c: factor * recording[c] for c, factor in named.items()})


def corrections(findings: Sequence[Finding]) -> dict[str, tuple[str, float]]:
    return {m.channel: (m.origin, m.scale) for f in findings for m in f.corrections}


@every_robot
def test_a_clean_recording_contradicts_nothing(name: str) -> None:
    assert found(robot_of(name), clean(name)) == ()


@pytest.mark.parametrize(("name", "factor"), [param(*values) for values in WRONG_TORQUES])
def test_a_torque_of_wrong_sign_or_unit_is_named_with_its_factor(name: str, factor: float | str) -> None:
    """At the first joint, and for a reversal at all joints at once."""
    robot, recording = robot_of(name), clean(name)
    joint = robot.moving_joints[0]
    assert joint.actuator is not None
    if isinstance(factor, str):
        factor = (-1.0 if factor.startswith("minus") else 1.0) / joint.actuator.gear_ratio
    channel = f"{joint.name}.torque"
    wrong = recording.with_channels({channel: factor * recording[channel]})
    seen = found(robot, wrong)
    assert set(corrections(seen)) == {channel}
    origin, scale = corrections(seen)[channel]
    assert origin == channel
    assert scale * factor == pytest.approx(1.0, rel=1e-9)
    shares = r"as it is, (100|\d\d) % of it stays unexplained .*, and corrected (less than )?[\d.]+ %"
    assert re.search(shares, seen[0].sentence)
    np.testing.assert_allclose(corrected(wrong, seen[0].corrections)[channel], recording[channel], rtol=1e-9)


@every_robot
def test_reversal_of_all_torques_is_recognised(name: str) -> None:
    robot, recording = robot_of(name), clean(name)
    channels = [f"{joint.name}.torque" for joint in robot.moving_joints]
    seen = found(robot, recording.with_channels({c: -recording[c] for c in channels}))
    assert corrections(seen) == {c: (c, -1.0) for c in channels}


@pytest.mark.parametrize("name", [param(name) for name in SHIPPED if name != "single_axis"])
def test_exchanged_torques_are_named(name: str) -> None:
    robot, recording = robot_of(name), clean(name)
    one, other = (f"{joint.name}.torque" for joint in robot.moving_joints[:2])
    seen = found(robot, recording.with_channels({one: recording[other], other: recording[one]}))
    assert {f.kind for f in seen} == {"exchanged"}
    assert corrections(seen) == {one: (other, 1.0), other: (one, 1.0)}


def test_missing_torque_constant_is_recognised() -> None:
    robot = robot_of("two_link_arm")
    joint = robot.moving_joints[1]
    assert joint.actuator is not None
    motor = joint.actuator.model_copy(update={"torque_constant": 0.05})
    joints = tuple(j.model_copy(update={"actuator": motor}) if j is joint else j for j in robot.joints)
    robot = robot.model_copy(update={"joints": joints})
    # The gear alone would be a factor of 80, milliamperes one of 1000; both stay apart from 0.05 * 80 * 1e-3.
    wrong = factors(clean("two_link_arm"), joint2__torque=1.0 / 80.0)
    assert corrections(found(robot, wrong)) == {"joint2.torque": ("joint2.torque", 80.0)}


@pytest.mark.parametrize("channel", ["joint1.position", "joint2.position"])
def test_a_position_in_degrees_or_reversed_is_recognised_by_the_torques(channel: str) -> None:
    """Nothing but positions and torques is recorded."""
    robot, recording = robot_of("two_link_arm"), without(clean("two_link_arm"), "reference_position")
    name = channel.replace(".", "__")
    assert corrections(found(robot, factors(recording, **{name: DEGREES}))) == {
        channel: (channel, pytest.approx(1 / DEGREES))
    }
    assert corrections(found(robot, factors(recording, **{name: -1.0}))) == {channel: (channel, -1.0)}


def test_positions_in_degrees_and_exchanged_positions_are_recognised() -> None:
    robot, recording = robot_of("two_link_arm"), without(clean("two_link_arm"), "reference_position")
    one, other = "joint1.position", "joint2.position"
    both = found(robot, factors(recording, joint1__position=DEGREES, joint2__position=DEGREES))
    assert set(corrections(both)) == {one, other}
    assert all(scale == pytest.approx(1 / DEGREES) for _, scale in corrections(both).values())
    crossed = found(robot, recording.with_channels({one: recording[other], other: recording[one]}))
    assert corrections(crossed) == {one: (other, 1.0), other: (one, 1.0)}


def test_gyro_in_degrees_or_with_wrong_sign_is_recognised() -> None:
    robot, recording = robot_of("six_joint_space_arm"), clean("six_joint_space_arm")
    recording = without(recording, *(f"attitude.{axis}" for axis in "wxyz"))
    gyro = [f"base.angular_velocity.{axis}" for axis in "xyz"]
    seen = found(robot, recording.with_channels({c: DEGREES * recording[c] for c in gyro}))
    assert corrections(seen) == {c: (c, pytest.approx(1 / DEGREES)) for c in gyro}
    seen = found(robot, recording.with_channels({gyro[1]: -recording[gyro[1]]}))
    assert corrections(seen) == {gyro[1]: (gyro[1], -1.0)}


PAYLOAD = {"effect": "payload", "at": "link2", "mass": 12.0, "x": 0.4, "y": 0.0, "z": 0.0}
LADEN: dict[str, tuple[dict[str, object], ...]] = {
    "torque delivered thrice": ({"effect": "torque_gain", "at": "joint1", "gain_error": 2.0},),
    "a tenth delivered": ({"effect": "torque_gain", "at": "joint2", "gain_error": -0.85},),
    "torque read as a tenth": ({"effect": "sensor_gain", "at": "joint1.torque", "gain_error": -0.9},),
    "torque read thrice": ({"effect": "sensor_gain", "at": "joint2.torque", "gain_error": 2.0},),
    "friction": (
        {"effect": "coulomb_friction", "at": "joint1", "torque": 20.0},
        {"effect": "viscous_friction", "at": "joint2", "coefficient": 15.0},
        {"effect": "coulomb_friction", "at": "joint2", "torque": 8.0},
    ),
    "encoder offset": ({"effect": "sensor_offset", "at": "joint1.position", "offset": 0.5},),
    "encoder gain": ({"effect": "sensor_gain", "at": "joint2.position", "gain_error": 0.5},),
    "payload": (PAYLOAD,),
    "delay": ({"effect": "sensor_delay", "at": "joint1.torque", "delay": 0.1},),
    "clock": ({"effect": "clock_drift", "at": "joint1.torque", "rate": 0.02},),
    "spring": ({"effect": "cable_spring", "at": "joint2", "stiffness": 60.0, "torque_at_zero": 5.0},),
    "stop": ({"effect": "end_stop", "at": "joint2", "stiffness": 3000.0, "position": 0.1},),
    "gravity": ({"effect": "gravity", "at": "base", "x": 6.0, "y": 0.0, "z": 14.0},),
    "all at once": (
        PAYLOAD,
        {"effect": "coulomb_friction", "at": "joint1", "torque": 20.0},
        {"effect": "torque_gain", "at": "joint1", "gain_error": -0.5},
        {"effect": "sensor_delay", "at": "joint2.torque", "delay": 0.05},
    ),
}


@pytest.mark.parametrize("hidden", LADEN.values(), ids=LADEN)
def test_hidden_physics_is_not_reported_as_a_channel_contradiction(
    hidden: tuple[dict[str, object], ...],
) -> None:
    """Up to the catalogue's limits, and friction of twice the inertial torque."""
    robot = robot_of("two_link_arm")
    true = robot.with_effects(*(EffectUse.model_validate(use) for use in hidden))
    assert found(robot, simulate(true, seed=10141)) == ()


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 9.81), (0.0, -9.81, 0.0), (0.0, 0.0, 0.0)])
def test_wrong_gravity_direction_in_the_file_is_not_reported_as_a_wrong_torque(
    gravity: tuple[float, float, float],
) -> None:
    robot = robot_of("two_link_arm").model_copy(update={"gravity": gravity})
    assert found(robot, clean("two_link_arm")) == ()


@pytest.mark.parametrize("damping", [80.0, 160.0])
def test_held_joint_that_yields_to_a_load_is_not_reported_as_a_wrong_torque(damping: float) -> None:
    """Its drive pushes back against a load that the robot file does not know: against the little motion."""
    robot = robot_of("two_link_arm").model_copy(update={"effects": ()})
    model, time = RobotModel(robot), np.arange(6000) / 250.0
    moved = 0.4 * np.sin(2 * np.pi * 0.31 * time) + 0.4 * np.sin(2 * np.pi * 0.53 * time + 1.0)
    load = 8.0 * np.sin(2 * np.pi * 0.2 * time) + 5.0 * np.cos(2 * np.pi * 0.43 * time)
    drive = 800.0 + 2j * np.pi * np.fft.rfftfreq(time.size, time[1]) * damping
    held = np.zeros_like(time)
    for _ in range(40):  # until motion and torque belong together
        position = np.column_stack([moved, held])
        velocity = np.gradient(position, time, axis=0)
        torque = model.inverse_dynamics(position, velocity, np.gradient(velocity, time, axis=0))
        torque[:, 1] += load
        push = torque[:, 1] - torque[:, 1].mean()
        held = 0.5 * held - 0.5 * np.fft.irfft(np.fft.rfft(push) / drive, time.size)
    chance = np.random.default_rng(10141)
    channels = {}
    for k, joint in enumerate(("joint1", "joint2")):
        channels[f"{joint}.position"] = position[:, k] + 1e-6 * chance.standard_normal(time.size)
        channels[f"{joint}.torque"] = torque[:, k] + 0.05 * chance.standard_normal(time.size)
    assert not found(robot, Recording(time, channels))


def test_unstable_robot_is_not_reported_as_a_wrong_torque() -> None:
    """Its controller pushes with all it has against the motion that it does not master."""
    robot, recording = robot_of("single_axis"), clean("single_axis")
    joint = robot.moving_joints[0]
    slower = joint.model_copy(update={"velocity_limit": np.ptp(recording["joint1.position"]) / 100.0})
    slow = robot.model_copy(
        update={"joints": tuple(slower if j.name == joint.name else j for j in robot.joints)}
    )
    told = found(slow, factors(recording, joint1__torque=-1.0))
    assert [finding.kind for finding in told] == ["runaway"]
    assert "times its velocity_limit" in told[0].sentence
    assert "window" in told[0].sentence
    assert not told[0].corrections
    assert [finding.kind for finding in found(robot, factors(recording, joint1__torque=-1.0))] == ["sign"]


@pytest.mark.proof
def test_diagnosis_stops_at_a_contradiction_unless_told_to_continue() -> None:
    robot, recording = robot_of("single_axis"), factors(clean("single_axis"), joint1__torque=-1.0)
    with pytest.raises(
        ContradictionError,
        match=r'joint1\.torque runs against the motion.*\[channels\."joint1\.torque"\] .*scale = -1',
    ) as error:
        diagnose(robot, [recording])
    assert str(error.value).count("\n") == 0
    options = Options(experiments=False, as_recorded=True)
    assert diagnose(robot, [recording], options=options).diagnosis.verdict != "consistent"


def test_suggested_correction_includes_the_present_map() -> None:
    mapping = mapping_from_toml(
        'time = { source = "t" }\n[channels."joint1.torque"]\nsource = "volts"\nscale = 35.0\noffset = 2.0\n'
    )
    robot, recording = robot_of("single_axis"), factors(clean("single_axis"), joint1__torque=-1.0)
    message = str(ContradictionError(recording, found(robot, recording), mapping))
    assert '[channels."joint1.torque"] source = "volts", scale = -35, offset = -2' in message
