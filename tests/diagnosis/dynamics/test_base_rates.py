"""What a gyro on a free base adds: equations without torque."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from floating_cases import GYRO, flyer
from numpy.typing import NDArray

from missing_physics.diagnosis import Diagnosis, Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.least_squares.explanation import explain
from missing_physics.diagnosis.preparation.setup import (
    build_problem,
    inertial_basis,
    make_segments,
    nominal_terms,
)
from missing_physics.diagnosis.preparation.split import Split, split
from missing_physics.diagnosis.preparation.tangent import about_the_fit
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, load_robot

pytestmark = pytest.mark.proof

Array = NDArray[np.float64]
PAYLOAD = {"effect": "payload", "at": "link2", "mass": 6.0, "x": 5.0, "y": 0.0, "z": 0.2}


def use(values: dict[str, object]) -> EffectUse:
    return EffectUse.model_validate(values)


def without_gyro(recording: Recording) -> Recording:
    return replace(recording, channels={c: recording[c] for c in recording if c not in GYRO})


@pytest.fixture(scope="module")
def arm() -> MotionDynamics:
    """The six-joint arm along its own recorded motion."""
    robot = load_robot("six_joint_space_arm")
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": 12.0, "sample_rate": 250.0})
    robot = robot.model_copy(update={"reference": reference})
    return make_segments(robot, [simulate(robot, seed=1)])[0].dynamics


@pytest.mark.parametrize(
    "name", ["link6.mass", "link3.first_moment.x", "base.inertia.zz", "link2.inertia.xy"]
)
def test_the_base_answers_a_changed_number_as_a_changed_model_does(arm: MotionDynamics, name: str) -> None:
    """Central differences of the reconstructed base motion; 1 % is what sampling at 250 Hz leaves."""
    model, motion = arm.model, arm.motion
    k = list(model.inertial_names).index(name)
    step = 1e-3 * max(1.0, abs(float(model.inertial[k])))
    rates = []
    for sign in (1.0, -1.0):
        numbers = model.inertial.copy()
        numbers[k] += sign * step
        state = motion.position, motion.velocity, motion.acceleration
        rates.append(model.reconstruct_base(motion.time, *state, inertial=numbers).angular_velocity)
    expected = (rates[0] - rates[1]) / (2 * step)
    got = arm.regressor[:, len(model.joints) :, k]
    np.testing.assert_allclose(got, expected, atol=1e-2 * np.abs(expected).max())


@pytest.mark.parametrize("joint", [0, 2])
def test_the_base_answers_another_joint_motion_as_a_reconstruction_does(
    arm: MotionDynamics, joint: int
) -> None:
    """An error that begins softly, so that the momentum at the start stays what it was."""
    model, motion = arm.model, arm.motion
    t = motion.time - motion.time[0]
    size, w = 1e-4, 2 * np.pi * 0.4
    envelope = size * np.sin(np.pi * t / t[-1]) ** 4 * np.sin(w * t)
    rate = np.gradient(envelope, t, edge_order=2)
    errors = [np.zeros((t.size, len(model.joints), 1)) for _ in range(3)]
    state = [motion.position.copy(), motion.velocity.copy(), motion.acceleration.copy()]
    for error, own, part in zip(errors, state, (envelope, rate, np.gradient(rate, t, edge_order=2))):
        error[:, joint, 0] = part
        own[:, joint] += part
    moved = model.reconstruct_base(motion.time, *state).angular_velocity
    still = model.reconstruct_base(
        motion.time, motion.position, motion.velocity, motion.acceleration
    ).angular_velocity
    got = arm.moved(errors)[:, len(model.joints) :, 0]
    np.testing.assert_allclose(got, moved - still, atol=2e-2 * np.abs(moved - still).max())


def test_a_gyro_agrees_with_the_joints_motion_down_to_the_noise() -> None:
    robot = flyer()
    segments = make_segments(robot, [simulate(robot, seed=3)])
    problem = build_problem(segments, inertial_basis(robot, segments))
    assert [output.channel for output in problem.outputs][-3:] == list(GYRO)
    left = np.sqrt(np.mean(problem.residual[:, -3:] ** 2, axis=0))
    # the floor is drawn from the same noise: a fifth is what some hundred independent samples allow
    np.testing.assert_allclose(left, problem.noise_floor[-3:], rtol=0.25)


def test_a_gyro_of_a_slower_clock_says_as_much_as_it_has_samples() -> None:
    robot = flyer()
    noisy = [s.model_copy(update={"noise": 5e-5}) if s.channel in GYRO else s for s in robot.sensors]
    robot = robot.model_copy(update={"sensors": tuple(noisy)})
    whole = simulate(robot, seed=3)
    every = np.arange(len(whole)) % 5 == 0
    slow = whole.with_channels({c: np.where(every, whole[c], np.nan) for c in GYRO})
    floors = []
    for recording in (whole, slow):
        segments = make_segments(robot, [recording])
        problem = build_problem(segments, inertial_basis(robot, segments))
        assert [output.channel for output in problem.outputs][-3:] == list(GYRO)
        floors.append(problem.noise_floor[-3:])
    left = np.sqrt(np.mean(problem.residual[:, -3:] ** 2, axis=0))
    # as above; a fifth of the samples leaves noise that is 2.2 times as large
    np.testing.assert_allclose(left, floors[1], rtol=0.25)
    np.testing.assert_array_less(1.8 * floors[0], floors[1])


def test_a_gyros_bias_says_nothing() -> None:
    robot = flyer(10.0)
    recording = simulate(robot, seed=3)
    biased = recording.with_channels({c: recording[c] + (0.01 if c in GYRO else 0.0) for c in recording})
    one, other = (make_segments(robot, [r])[0] for r in (recording, biased))
    np.testing.assert_allclose(one.measured[:, -3:], other.measured[:, -3:], atol=1e-12)


def test_a_large_payload_is_linearised_where_it_is() -> None:
    """What the linearisation about nominal leaves of the exact payload is not noise; about the fit it is."""
    robot = flyer(base=(150.0, 35.0))
    segments = make_segments(robot, [simulate(robot.with_effects(use(PAYLOAD)), seed=4)])
    basis = inertial_basis(robot, segments)
    data = split(segments, 1, basis, seed=0)
    payload = Term(get_effect("payload"), "link2", {"mass": 6.0, "x": 5.0, "y": 0.0, "z": 0.2}, frozen=True)
    terms = [*nominal_terms(robot), payload]

    def left(part: Split) -> Array:
        fit = explain(part.problem, part.view, terms, nuisance=False)
        return np.sqrt(np.mean(fit.residual[part.scored] ** 2, axis=0)) / part.problem.noise_floor

    assert left(data).max() > 3.0
    start = explain(data.problem, data.view, terms, nuisance=True)
    moved = about_the_fit(data, basis, start, nuisance=True, seed=0)
    assert moved is not None
    # the floor is drawn from the same noise: what some hundred independent samples allow
    assert left(moved).max() < 1.4


def named(found: Diagnosis) -> set[str]:
    """Everything that is named or said to be as likely."""
    labels = {f"{f.effect}@{f.location}" for f in found.findings}
    return labels | {label for f in found.findings for label in f.ambiguous_with}


@pytest.mark.parametrize(
    "hidden",
    [
        {"effect": "payload", "at": "link1", "mass": 5.0, "x": 3.0, "y": 0.0, "z": 0.0},
        {"effect": "payload", "at": "link1", "mass": 2.0, "x": 1.8, "y": 0.0, "z": 0.0},
        {"effect": "torque_gain", "at": "joint1", "gain_error": -0.08},
    ],
    ids=["payload", "payload along the link", "torque gain"],
)
def test_only_a_gyro_tells_a_payload_from_a_torque_gain_in_weightlessness(hidden: dict[str, object]) -> None:
    """One joint over the base's centre of mass: its torque is one constant inertia times its acceleration."""
    robot = flyer(joints=1).model_copy(update={"effects": ()})
    recording = simulate(robot.with_effects(use(hidden)), seed=5)
    label = f"{hidden['effect']}@{hidden['at']}"
    options = Options(experiments=False, simulation=False)
    seen = diagnose(robot, [recording], options=options).diagnosis
    # that the actuator or its sensor is wrong, no motion of a base tells
    gain = {"torque_gain@joint1", "sensor_gain@joint1.torque"}
    assert named(seen) == (gain if label in gain else {label})
    for finding in (f for f in seen.findings if f.effect == "payload"):
        # mass and place are one number here: that of the mass spans what a place nearby would make of it
        low, high = finding.parameters["mass"].ci95
        assert low <= float(str(hidden["mass"])) <= high
        assert high - low > 0.1 * high or "x" in finding.parameters
    blind = diagnose(robot, [without_gyro(recording)], options=options).diagnosis
    if hidden.get("mass", 0.0) == 5.0:  # it would take a gain that no drive has, which is no rival then
        assert blind.verdict != "consistent"
        return
    assert blind.verdict == "ambiguous"
    assert {"torque_gain@joint1", label} <= named(blind)
    assert len(named(blind)) > 1
