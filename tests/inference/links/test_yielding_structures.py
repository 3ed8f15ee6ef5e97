"""Compliant bases, and links that bend although the robot file calls them rigid, in recordings of joints."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import pytest

from missing_physics.diagnosis import Options, Result, diagnose
from missing_physics.evaluation.vibration.newmark import newmark, vibrating
from missing_physics.hypotheses import Term
from missing_physics.inference.torques.columns import columns_of
from missing_physics.inference.torques.data import TorqueData
from missing_physics.inference.torques.yielding import rows_of_yielding, stretch_of
from missing_physics.standard import fit_standard
from reference_model.effects.catalogue import get_effect
from reference_model.effects.structure import StructureEffect
from reference_model.passive.prescribed import prescribed
from robot_model import EffectUse, Recording, Robot, load_robot

RATE, LENGTH = 250.0, 12.0
MOUNT = {"compliance": 1e-5, "arm": 0.5, "damping": 1e-3, "mass": 50.0, "inertia": 8.0}
BEAM = {"period": 0.15, "damping_ratio": 0.02}
#: Noise of the encoders [rad] and of the torques [N m].
ENCODER, TORQUE = 1e-6, 0.01


@lru_cache
def arm(name: str = "two_link_arm") -> Robot:
    return load_robot(name).model_copy(update={"effects": ()})


def use_of(effect: str, at: str, values: Mapping[str, float]) -> EffectUse:
    return EffectUse.model_validate({"effect": effect, "at": at, **values})


@lru_cache
def recorded(name: str, effect: str, at: str, seed: int) -> Recording:
    """Positions and torques of an arm with a hidden effect, on sines that begin smoothly."""
    generator = np.random.default_rng(seed)
    values = MOUNT if effect == "base_motion" else BEAM
    robot = arm(name) if not effect else arm(name).with_effects(use_of(effect, at, values))
    time = np.arange(0.0, LENGTH, 1.0 / RATE)
    slow = np.clip(time / 3.0, 0.0, 1.0)
    ramp, count = slow**3 * (10.0 - 15.0 * slow + 6.0 * slow**2), len(robot.moving_joints)
    phases, rates = generator.uniform(0.0, 6.0, (2, count)), generator.uniform(0.5, 1.2, (2, count))
    sines = 0.3 * np.sin(2.0 * np.pi * rates[:, None] * time[:, None] + phases[:, None]).sum(axis=0)
    position = ramp[:, None] * sines
    velocity = np.gradient(position, time, axis=0, edge_order=2)
    acceleration = np.gradient(velocity, time, axis=0, edge_order=2)
    made = prescribed(robot, time, position, velocity, acceleration)
    channels = {}
    for k, joint in enumerate(robot.moving_joints):
        channels[f"{joint.name}.position"] = position[:, k] + generator.normal(0.0, ENCODER, time.size)
        torque = made[f"{joint.name}.torque"] + generator.normal(0.0, TORQUE, time.size)
        channels[f"{joint.name}.torque"] = torque
    return Recording(time, channels, f"recording {seed}")


@pytest.mark.parametrize(
    ("name", "effect", "at"),
    [
        ("two_link_arm", "base_motion", "base"),
        ("two_link_arm", "link_flexibility", "link1"),
        ("two_link_arm", "link_flexibility", "link2"),
        ("six_joint_space_arm", "link_flexibility", "link2"),
    ],
)
def test_torques_of_what_yields_are_those_of_the_reference_model(name: str, effect: str, at: str) -> None:
    """To first order in the deflections, and with the vibration of the start found from the recording."""
    robot = arm(name)
    values = MOUNT if effect == "base_motion" else BEAM
    real, rigid = recorded(name, effect, at, 1), recorded(name, "", "", 1)
    data = TorqueData.of(fit_standard(robot, [real]), [real])
    run = data.about(data.file_values).runs[0]
    found = columns_of(Term.of(get_effect(effect), at, values), run, 0)[:, :, 0]
    step = [real[f"{j}.torque"] - rigid[f"{j}.torque"] for j in run.model.joints]
    full = np.column_stack([np.interp(run.motion.time, real.time, own) for own in step])
    due = run.reduce(full) * run.rows.counted
    assert np.sqrt(np.mean(due**2)) > 5.0 * TORQUE  # it shows
    # terms of second order in the deflections are left out, and the first seconds' forces are smoothed
    assert np.sqrt(np.mean((found - due) ** 2)) < 0.05 * np.sqrt(np.mean(due**2)) + TORQUE


@pytest.mark.parametrize(("effect", "at"), [("base_motion", "base"), ("link_flexibility", "link2")])
def test_columns_are_derivatives_of_the_torques_beyond_vibrations(effect: str, at: str) -> None:
    """The vibration of the start is a nuisance, found anew at both ends of each difference."""
    real = recorded("two_link_arm", effect, at, 1)
    data = TorqueData.of(fit_standard(arm(), [real]), [real])
    run = data.about(data.file_values).runs[0]
    values = MOUNT if effect == "base_motion" else BEAM
    law = get_effect(effect)
    assert isinstance(law, StructureEffect)
    term = Term.of(law, at, values)
    columns = columns_of(term, run, 0)
    vibrations = rows_of_yielding(law, at, run, [term.parameters])[:, :, 0, 1:]
    basis = np.linalg.qr(vibrations.reshape(-1, vibrations.shape[2]))[0]

    def beyond(series: np.ndarray) -> np.ndarray:
        flat = series.ravel()
        return np.asarray(flat - basis @ (basis.T @ flat))

    errors, sizes = [], []
    for k, p in enumerate(term.free):
        step = 1e-3 * max(values[p.name], p.typical)
        ends = [columns_of(term.moved({p.name: values[p.name] + s}), run, 0)[:, :, 0] for s in (-step, step)]
        due = beyond(ends[1] - ends[0]) / (2.0 * step) * p.typical
        sizes.append(np.linalg.norm(due))
        errors.append(np.linalg.norm(beyond(columns[:, :, 1 + k]) * p.typical - due))
    # the change of the vibrations' shape times the residual is left out: a tenth near a resonance
    assert max(errors) < 0.1 * max(sizes)


@lru_cache
def diagnosed(effect: str, at: str) -> Result:
    recordings = [recorded("two_link_arm", effect, at, seed) for seed in (1, 2)]
    return diagnose(arm(), recordings[:1], recordings[1:], options=Options(experiments=False))


def test_a_link_that_bends_is_named_with_its_period() -> None:
    found = diagnosed("link_flexibility", "link1").diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("link_flexibility", "link1")]
    # the estimated bodies that it carries change its period by a few percent
    assert found.findings[0].parameters["period"].value == pytest.approx(BEAM["period"], rel=0.05)


def test_a_compliant_base_is_named() -> None:
    found = diagnosed("base_motion", "base").diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("base_motion", "base")]
    values = {name: value.value for name, value in found.findings[0].parameters.items()}
    turning, due = (own["arm"] ** 2 / own["compliance"] for own in (values, MOUNT))
    assert turning == pytest.approx(due, rel=0.2)  # the only stiffness that a planar arm loads


def test_a_rigid_arm_on_a_rigid_base_is_consistent() -> None:
    result = diagnosed("", "")
    assert result.diagnosis.verdict == "consistent"


def test_structures_are_sought_where_the_standard_model_errs_most() -> None:
    """A recording that begins at rest shows none there."""
    real = recorded("two_link_arm", "base_motion", "base", 1)
    rest = np.arange(0.0, 20.0, 1.0 / RATE)
    generator = np.random.default_rng(3)
    first = {
        name: own[0] + generator.normal(0.0, own[:25].std(), rest.size) for name, own in real.channels.items()
    }
    time = np.concatenate([rest, rest[-1] + 1.0 / RATE + real.time])
    joined = {name: np.concatenate([first[name], own]) for name, own in real.channels.items()}
    later = Recording(time, joined, "at rest, then moving")
    run = TorqueData.of(fit_standard(arm(), [later]), [later]).runs[0]
    rows = run.rows.time
    begin, end = stretch_of(run, 200, np.ones(rows.size, dtype=bool))
    assert begin > rest[-1]
    assert end <= time[-1]
    first, last = stretch_of(run, 200, (rows < begin) | (rows > end))
    assert first >= end or last <= begin  # rows that are held out do not decide


def test_phase_of_a_vibration_has_an_error_of_fourth_order() -> None:
    frequency, ends = 5.0, []
    for step in (0.1, 0.05):
        count = round(1000.0 / step)  # the error of the phase exceeds that of the amplitudes
        inertia = np.ones((count + 1, 1, 1))
        stiffness, damping = np.full((1, 1), frequency**2), np.zeros((1, 1))
        start = np.ones((1, 1)), np.zeros((1, 1))
        implicit = newmark(inertia[0], stiffness, step)
        place, rate, _ = vibrating(
            inertia, stiffness, damping, np.zeros((count + 1, 1, 1)), step, start, implicit
        )
        phase = np.unwrap(np.arctan2(-rate[:, 0, 0] / frequency, place[:, 0, 0]))
        ends.append(abs(phase[-1] - frequency * step * count))
    assert ends[0] / ends[1] == pytest.approx(16.0, rel=0.15)


def test_modes_too_fast_for_the_step_are_stable() -> None:
    inertia, step, count = np.ones((1001, 2, 2)) * np.eye(2), 0.01, 1001
    stiffness = np.diag([25.0, 1e6])
    implicit = newmark(inertia[0], stiffness, step)
    start = np.ones((2, 1)), np.zeros((2, 1))
    place, _, _ = vibrating(
        inertia, stiffness, np.zeros((2, 2)), np.zeros((count, 2, 1)), step, start, implicit
    )
    assert np.abs(place).max() < 1.01
