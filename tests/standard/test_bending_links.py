"""The standard model of robots with flexible links: response to small forces, beam parameters, vibration."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray

from missing_physics.evaluation import evaluate
from missing_physics.evaluation.band import Band
from missing_physics.evaluation.vibration.whitening import UNKNOWN, Vibration
from missing_physics.standard import fit_standard
from missing_physics.standard.band import BandMotion, band_motion
from missing_physics.standard.bending import model_of
from missing_physics.standard.prediction import Along, inertial_with_effects
from missing_physics.standard.rows import rows_of, without_friction
from reference_model.evaluation.model import RobotModel
from reference_model.plant.truth import truth_of
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, load_robot

Array = NDArray[np.float64]

#: Length of the recordings [s] and their band [Hz], which holds the link's first bending mode (2.3 Hz).
LENGTH, BAND = 8.0, 3.0


@lru_cache
def space_robot() -> Robot:
    """A free base, a rigid link, and a beam with a load at its tip; viscous friction at both joints."""
    robot = load_robot("flexible_space_robot")
    uses = [
        EffectUse.model_validate({"effect": "viscous_friction", "at": joint, "coefficient": 20.0})
        for joint in ("joint1", "joint2")
    ]
    return robot.model_copy(update={"effects": tuple(uses)})


def with_beam(robot: Robot, **changes: float) -> Robot:
    """The robot with some keys of its beam multiplied; `tip` is the mass there."""
    link = robot.link("link2")
    assert link.beam is not None
    keys = {key: getattr(link.beam, key) * factor for key, factor in changes.items() if key != "tip"}
    tip = link.beam.tip.model_copy(update={"mass": link.beam.tip.mass * changes.get("tip", 1.0)})
    beam = link.beam.model_copy(update={**keys, "tip": tip})
    links = tuple(
        one.model_copy(update={"beam": beam}) if one.name == "link2" else one for one in robot.links
    )
    return robot.model_copy(update={"links": links})


@lru_cache
def recorded(robot_of: str = "file", seed: int = 1) -> Recording:
    """A recording of the robot on two sines a joint, with the noise of its sensors."""
    robot = {"file": space_robot(), "heavy": with_beam(space_robot(), tip=1.1, young=0.95, shear=0.95)}[
        robot_of
    ]
    data = robot.model_dump(mode="python")
    generator = np.random.default_rng(seed)
    data["reference"] = {
        "duration": LENGTH,
        "sample_rate": 100.0,
        "joints": [
            {
                "joint": joint,
                "kind": "multisine",
                "amplitudes": generator.uniform(0.02, 0.06, 2).tolist(),
                "frequencies": generator.uniform(0.08, 0.3, 2).tolist(),
                "ramp": 2.0,
            }
            for joint in ("joint1", "joint2")
        ],
    }
    made = simulate(Robot.model_validate(data), seed=seed)
    kept = [f"joint{k}.{quantity}" for k in (1, 2) for quantity in ("position", "torque")]
    return Recording(made.time, {channel: made[channel] for channel in kept}, f"recording {seed}")


@lru_cache
def moved() -> tuple[RobotModel, BandMotion, Along]:
    """The file's model along a recorded motion."""
    model = model_of(without_friction(space_robot()))
    motion = band_motion(space_robot(), recorded(), BAND)
    return model, motion, Along.of(model, motion, inertial_with_effects(model))


@pytest.mark.parametrize("name", ["link1.mass", "base.inertia.zz", "link2.tip_mass", "link2.stiffness"])
def test_regressor_is_the_torque_derivative_with_changed_link_vibration(name: str) -> None:
    model, motion, along = moved()
    place, step = model.inertial_names.index(name), 1e-3
    more = along.inertial.copy()
    more[place] *= 1.0 + step
    change = motion.reduce(Along.of(model, motion, more).needed - along.needed)
    predicted = motion.reduce(along.regressor[:, :, place]) * (more[place] - along.inertial[place])
    # The phase of a vibration errs by (w h)^2 / 12 of itself, 0.2 % or 0.2 rad at the end, and Coriolis terms
    # of the deviations are left out.
    error = np.sqrt(np.mean((predicted - change) ** 2, axis=0)) / np.sqrt(np.mean(change**2, axis=0))
    assert np.all(error < 0.1)


def test_tip_mass_equals_a_payload_at_the_tip() -> None:
    model, motion, along = moved()
    robot = without_friction(space_robot())
    load = EffectUse.model_validate(
        {"effect": "payload", "at": "link2", "mass": 3.0, "x": 6.0, "y": 0.0, "z": 0.0}
    )
    truth = truth_of(robot.with_effects(load))
    bodies = {body.name: body.flexible for body in truth.tree.bodies if body.flexible is not None}
    more = along.inertial.copy()
    more[model.inertial_names.index("link2.tip_mass")] += 3.0
    state = motion.position, motion.velocity, motion.acceleration
    expected = RobotModel(robot, bodies=bodies).inverse_dynamics(*state, base=along.base, inner=along.inner)
    found = model.inverse_dynamics(*state, base=along.base, inner=along.inner, inertial=more)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_stiffness_of_a_beam_is_its_young_and_shear_modulus() -> None:
    model, motion, along = moved()
    undamped = with_beam(without_friction(space_robot()), damping_ratio=0.0)
    stiff = RobotModel(with_beam(undamped, young=1.3, shear=1.3))
    state, still = (motion.position, motion.velocity, motion.acceleration), along.inner
    assert still is not None
    more = inertial_with_effects(model_of(undamped))
    more[model.inertial_names.index("link2.stiffness")] = 1.3
    expected = stiff.inverse_dynamics(*state, base=along.base, inner=still)
    found = model_of(undamped).inverse_dynamics(*state, base=along.base, inner=still, inertial=more)
    # Signs of mode shapes are arbitrary, and a robot file holds ten digits.
    np.testing.assert_allclose(np.abs(found), np.abs(expected), rtol=0, atol=1e-6 * np.abs(expected).max())


def test_vibration_errors_are_whitened() -> None:
    generator = np.random.default_rng(3)
    columns, spread = generator.normal(size=(40, 2, 5)), np.array([np.inf, 0.3, 2.0, 1e-3, 5.0])
    weight = np.tile([4.0, 0.25], (40, 1))
    whitened = Vibration.of(columns, weight, spread)
    wide = spread.copy()
    wide[0] = UNKNOWN / np.linalg.norm(columns[:, :, 0] * np.sqrt(weight))  # the prior of what has none
    flat = columns.reshape(80, 5) * wide
    covariance = np.diag(1.0 / weight.ravel()) + flat @ flat.T
    matrix = whitened.removed(np.eye(80).reshape(40, 2, 80)).reshape(80, 80)
    white = matrix @ covariance @ matrix.T * np.sqrt(np.outer(weight.ravel(), weight.ravel()))
    np.testing.assert_allclose(white, np.eye(80), atol=1e-6)


def test_initial_vibration_of_a_link_leaves_no_residual() -> None:
    whole, robot = recorded(), space_robot()
    late = whole.time >= 2.0
    part = Recording(whole.time[late] - 2.0, {c: v[late] for c, v in whole.channels.items()}, "part")
    left = evaluate(robot, part, Band(BAND, 5.0 * BAND))
    torque = np.sqrt(np.mean(left.measured[:, :2] ** 2, axis=0))
    # The model's own error of torques is 0.3 % (`standard.rows.MODEL_ERROR`).
    assert np.all(np.sqrt(np.mean(left.residual[:, :2] ** 2, axis=0)) < 0.003 * torque + 0.02)


def test_standard_model_of_a_changed_beam_predicts_up_to_noise() -> None:
    standard = fit_standard(space_robot(), [recorded("heavy", 2)], cutoff=BAND)
    errors = standard.errors([recorded("heavy", 4)])
    for joint in ("joint1", "joint2"):
        assert errors[joint].standard < 0.25 * errors[joint].nominal
        assert errors[joint].standard < 0.003 * errors[joint].measured + 2.0 * errors[joint].noise
    tip, _ = standard.estimate.value("link2.tip_mass")
    beam = standard.robot.link("link2").beam
    assert beam is not None
    assert beam.tip.mass == pytest.approx(tip, rel=1e-9)


def test_vibration_due_to_encoder_noise_explains_the_residual_of_the_exact_file() -> None:
    """With encoders that are ten times as noisy, the exact file's residual is mostly what they shake."""
    level, generator = 2e-5, np.random.default_rng(9)
    sensors = tuple(
        one.model_copy(update={"noise": level}) if one.channel.endswith("position") else one
        for one in space_robot().sensors
    )
    robot = space_robot().model_copy(update={"sensors": sensors})
    noisy = {
        channel: values + level * channel.endswith("position") * generator.standard_normal(values.size)
        for channel, values in recorded().channels.items()
    }
    recording = Recording(recorded().time, noisy, "noisy")
    rows = rows_of(model_of(without_friction(robot)), recording, BAND)
    left = evaluate(robot, recording, Band(BAND, 5.0 * BAND))
    rms = np.sqrt(np.mean(left.residual[:, :2] ** 2, axis=0))
    assert np.all(rows.shaken > rows.noise)
    # One realisation of narrow-band noise over some twenty periods is known to a third.
    assert np.all((rms > 0.6 * rows.shaken) & (rms < 1.6 * rows.shaken))
