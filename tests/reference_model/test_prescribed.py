"""Prescribed joint motion reproduces the closed loop along the same motion, effects included."""

from __future__ import annotations

import numpy as np
import pytest
from quick_ones import quick_places

from reference_model.evaluation.model import RobotModel
from reference_model.passive.prescribed import prescribed
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, Robot, load_robot


def effect(name: str, at: str, **parameters: float) -> EffectUse:
    return EffectUse.model_validate({"effect": name, "at": at, **parameters})


def short(name: str, *, duration: float = 1.0, rate: float = 500.0) -> Robot:
    robot = load_robot(name)
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": duration, "sample_rate": rate})
    return robot.model_copy(update={"reference": reference, "sensors": ()})


CASES: list[tuple[str, tuple[EffectUse, ...]]] = [
    ("six_joint_space_arm", (effect("slosh", "base", mass=20.0, frequency=2.0, x=0.1),)),
    ("two_link_arm", (effect("base_motion", "base", compliance=2e-5, mass=80.0, inertia=10.0),)),
    ("six_joint_space_arm", (effect("contact", "link6", stiffness=1e5, offset=1.85, z=0.2, damping=0.1),)),
    ("flexible_space_robot", ()),
    ("flexible_space_robot", (effect("modal_damping", "link2", damping_ratio=0.05),)),
    ("flexible_space_robot", (effect("reaction_wheel", "base", momentum_x=20.0, momentum_z=-5.0),)),
    ("six_joint_space_arm", (effect("link_flexibility", "link3", period=0.1, modes=2.0),)),
    (
        "two_link_arm",
        (effect("link_flexibility", "link2", period=0.05), effect("payload", "link2", mass=1.0)),
    ),
]


@pytest.mark.parametrize(("name", "effects"), quick_places(CASES, 1, 2, 3, 7))
def test_it_follows_the_closed_loop(name: str, effects: tuple[EffectUse, ...]) -> None:
    robot = short(name).model_copy(update={"effects": effects})
    full = simulate(robot, sensors=False, rtol=1e-11, atol=1e-13)
    names = [joint.name for joint in robot.moving_joints]
    joints = [
        np.column_stack([full[f"{n}.{what}"] for n in names])
        for what in ("position", "velocity", "acceleration")
    ]
    found = prescribed(robot, full.time, *joints)
    assert any("base." in channel or "tip" in channel for channel in found.channels)
    part = 1e-3 if any(use.effect == "contact" for use in effects) else 1e-4
    for channel in found.channels:
        alike = [c for c in found.channels if c.rsplit(".", 1)[0] == channel.rsplit(".", 1)[0]]
        alike = alike if channel.count(".") == 2 else [channel]  # axes of one vector share a size
        size = max(1e-6, *(float(np.abs(full[c]).max()) for c in alike))
        # Quintics between samples 2 ms apart of a motion that rings at up to 50 Hz, and Runge-Kutta steps of
        # 0.3 rad: both relative errors of 1e-5 a turn of the fastest mode, of which there are some tens. A
        # contact changes accelerations within a sample.
        np.testing.assert_allclose(found[channel], full[channel], rtol=0, atol=part * size, err_msg=channel)


def test_it_follows_from_momentum_for_a_rigid_robot() -> None:
    """Against `RobotModel`, which knows the base's twist from momentum and integrates its attitude alone."""
    robot = short("six_joint_space_arm").model_copy(update={"effects": ()})
    full = simulate(robot, sensors=False)
    names = [joint.name for joint in robot.moving_joints]
    state = [
        np.column_stack([full[f"{n}.{w}"] for n in names]) for w in ("position", "velocity", "acceleration")
    ]
    base = RobotModel(robot).reconstruct_base(full.time, *state)
    found = prescribed(robot, full.time, *state)
    for k, axis in enumerate("xyz"):
        rate = found[f"base.angular_velocity.{axis}"]
        # Samples 2 ms apart; both are of fourth order.
        np.testing.assert_allclose(rate, base.angular_velocity[:, k], rtol=0, atol=1e-8)


def test_unsupported_robots_are_refused() -> None:
    robot = load_robot("two_link_arm")
    with pytest.raises(InputError, match=r"position has shape \(3, 1\)"):
        prescribed(robot, np.arange(3.0), np.zeros((3, 1)), np.zeros((3, 2)), np.zeros((3, 2)))


def test_a_single_sample_gives_the_initial_state() -> None:
    robot = load_robot("six_joint_space_arm").model_copy(update={"effects": ()})
    speeds = np.array([[0.1, -0.2, 0.3, 0.1, 0.0, 0.4]])
    found = prescribed(robot, [0.0], 0 * speeds, speeds, 0 * speeds)
    momenta = [found[f"robot.{what}_momentum.{a}"][0] for what in ("linear", "angular") for a in "xyz"]
    np.testing.assert_allclose(momenta, 0.0, atol=1e-12)
