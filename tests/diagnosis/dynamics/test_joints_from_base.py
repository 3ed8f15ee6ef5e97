"""Joints without an encoder, whose motion a free base's gyro or attitude tells; friction found with it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from floating_cases import GYRO, flyer

from exudyn_model.simulation import simulate as simulate_in_exudyn
from missing_physics.diagnosis import Diagnosis, Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.dynamics.joints_from_base import ATTITUDE, joints_from_base
from missing_physics.diagnosis.preparation.setup import make_dynamics
from reference_model.evaluation.model import RobotModel
from reference_model.plant.sensing import measure
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, Recording, Robot, Sensor, load_robot

NOISE, ATTITUDE_NOISE = 2e-6, 2e-6
OPTIONS = Options(experiments=False)


def floating(joints: int, duration: float = 12.0) -> Robot:
    """The flyer with an attitude sensor."""
    robot = flyer(duration, joints=joints)
    sensors = tuple(Sensor(channel=channel, noise=ATTITUDE_NOISE) for channel in ATTITUDE)
    return robot.model_copy(update={"sensors": (*robot.sensors, *sensors)})


def without(recording: Recording, *channels: str) -> Recording:
    kept = {name: values for name, values in recording.channels.items() if name not in channels}
    return replace(recording, channels=kept)


@lru_cache(maxsize=2)
def truth(joints: int) -> Recording:
    return simulate(floating(joints), sensors=False)


def recorded(joints: int, seed: int) -> Recording:
    exact = truth(joints)
    return measure(floating(joints), exact.time, exact.channels, seed=seed, source="flight")


POSITIONS = ("joint1.position", "joint2.position")


@pytest.mark.parametrize(
    ("missing", "unseen"),
    [
        (POSITIONS, ATTITUDE),
        (POSITIONS, GYRO),
        (POSITIONS[:1], ("base.angular_velocity.x", *ATTITUDE)),
        (POSITIONS[1:], ATTITUDE),
    ],
    ids=["both by gyro", "both by attitude", "first by two axes", "second by gyro"],
)
def test_positions_come_back_with_the_noise_that_is_stated(
    missing: tuple[str, ...], unseen: tuple[str, ...]
) -> None:
    robot, seen = floating(2), without(recorded(2, 10820), *missing, *unseen)
    found = joints_from_base(RobotModel(robot), seen, dict(seen.noise))
    assert found is not None
    step, apart = float(seen.time[1] - seen.time[0]), 40
    for channel in missing:
        error = found.recording[channel] - truth(2)[channel]
        walk = found.walk[channel.split(".")[0]] * step
        stated = np.sqrt(2 * found.noise[channel] ** 2 + apart * walk**2)
        # differences over 0.4 s, 29 or more that are independent: 40 % are three standard deviations
        assert np.std(error[apart:] - error[:-apart]) == pytest.approx(stated, rel=0.4)
        assert abs(error[0]) < 6 * (found.noise[channel] + walk) + 1e-9


def test_an_attitude_takes_a_gyros_bias_away() -> None:
    robot, plain = floating(2), without(recorded(2, 10821), *POSITIONS)
    seen = plain.with_channels({channel: plain[channel] + 1e-3 for channel in GYRO})
    ends = []
    for recording in (seen, without(seen, *ATTITUDE)):
        found = joints_from_base(RobotModel(robot), recording, dict(recording.noise))
        assert found is not None
        ends.append(abs(float(found.recording["joint2.position"][-1] - truth(2)["joint2.position"][-1])))
    assert ends[0] < 1e-3
    assert ends[1] > 5e-3


@pytest.mark.parametrize(
    ("robot", "recording", "words"),
    [
        (
            floating(2),
            without(recorded(2, 10822), *POSITIONS, *GYRO[:2], *ATTITUDE),
            r"joint1, joint2: 2 joints, and how the base turns gives 1 equation of momentum .* at least 1",
        ),
        (floating(2), without(recorded(2, 10822), *POSITIONS, *GYRO, *ATTITUDE), "determines as many joints"),
    ],
    ids=["one axis", "no gyro"],
)
def test_too_few_equations_are_reported(robot: Robot, recording: Recording, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make_dynamics(robot, [recording])


def test_joints_that_turn_the_base_in_the_same_way_are_reported() -> None:
    planar = floating(2)
    joints = tuple(
        joint.model_copy(update={"axis": (0.0, 0.0, 1.0), "origin": (*joint.origin[:2], 0.0)})
        for joint in planar.joints
    )
    planar = planar.model_copy(update={"joints": joints})
    with pytest.raises(InputError, match="joint1, joint2, and the base does not determine them"):
        make_dynamics(planar, [without(recorded(2, 10822), *POSITIONS)])


def test_links_that_bend_are_reported() -> None:
    robot = load_robot("flexible_space_robot")
    seen = without(recorded(2, 10822), *POSITIONS)
    with pytest.raises(InputError, match="flexible links turn the base too"):
        make_dynamics(robot, [seen])


def friction(robot: Robot, joint: str, torque: float) -> Robot:
    return robot.with_effects(EffectUse(effect="coulomb_friction", at=joint, torque=torque))


@pytest.mark.proof
@pytest.mark.parametrize(
    ("joints", "at", "unseen"),
    [(1, "joint1", ATTITUDE), (2, "joint2", ())],
    ids=["one joint, gyro", "two joints, gyro and attitude"],
)
def test_friction_is_found_without_an_encoder(joints: int, at: str, unseen: tuple[str, ...]) -> None:
    """In the other engine's recording: which friction, where, and how much, from gyro and torque alone."""
    robot = floating(joints)
    recording = simulate_in_exudyn(friction(robot, at, 3.0), seed=10823)
    found = diagnose(robot, [without(recording, *POSITIONS, *unseen)], options=OPTIONS).diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("coulomb_friction", at)]
    assert found.findings[0].probability > 0.9
    low, high = found.findings[0].parameters["torque"].ci95
    assert low < 3.0 < high
    assert high - low < 0.3
    assert any("no encoder" in note for note in found.notes)
    assert not _at_encoders(found)


def test_nothing_is_found_where_nothing_is_missing() -> None:
    robot = floating(1)
    seen = without(recorded(1, 10824), *POSITIONS, *ATTITUDE)
    found = diagnose(robot, [seen], options=OPTIONS).diagnosis
    assert found.findings == ()
    assert found.verdict == "consistent"


def _at_encoders(found: Diagnosis) -> set[str]:
    rivals = {label for finding in found.findings for label in finding.ambiguous_with}
    rivals |= {f"{a.effect}@{a.location}" for finding in found.findings for a in finding.alternatives}
    return {label for label in rivals if label.endswith(".position")}
