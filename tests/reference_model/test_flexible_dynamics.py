"""The flexible robot: forward and inverse dynamics, and conserved quantities."""

from __future__ import annotations

import numpy as np
import pytest

from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion
from reference_model.simulation import simulate
from robot_model import EffectUse, load_robot

SAMPLES = 5


def motion_of(model: RobotModel, seed: int) -> tuple[BaseMotion, InnerMotion]:
    """A base and modes that move at random."""
    chance = np.random.default_rng(seed)
    base = BaseMotion(chance.normal(size=(SAMPLES, 4)), *(chance.normal(size=(SAMPLES, 3)) for _ in range(4)))
    rest = InnerMotion.at_rest(model.robot, SAMPLES)
    rows = (SAMPLES, model.tree.modal)
    inner = InnerMotion(
        rest.balls,
        rest.ball_rates,
        rest.ball_accelerations,
        0.1 * chance.normal(size=rows),
        chance.normal(size=rows),
        np.zeros(rows),
    )
    return base, inner


@pytest.mark.parametrize("name", ["flexible_space_robot", "flexible_space_robot_planar"])
def test_forward_dynamics_inverts_inverse_dynamics(name: str) -> None:
    model = RobotModel(load_robot(name))
    base, inner = motion_of(model, seed=1)
    chance = np.random.default_rng(2)
    q, qd, torque = (chance.normal(size=(SAMPLES, 2)) for _ in range(3))
    found = model.forward_dynamics(q, qd, torque, base=base, inner=inner)
    moved_base = BaseMotion(
        base.attitude, base.angular_velocity, base.linear_velocity, found[:, 3:6], found[:, :3]
    )
    moved = InnerMotion(
        inner.balls,
        inner.ball_rates,
        inner.ball_accelerations,
        inner.modal,
        inner.modal_rates,
        found[:, 8:],
    )
    back = model.inverse_dynamics(q, qd, found[:, 6:8], base=moved_base, inner=moved)
    wanted = np.hstack([np.zeros((SAMPLES, 6)), torque, np.zeros((SAMPLES, model.tree.modal))])
    # relative to the inertial forces of a base of a tonne at about 1 m/s^2 over 10 m
    assert np.abs(back - wanted).max() < 1e-10 * 1e4


def test_free_flight_conserves_momentum() -> None:
    recording = simulate(load_robot("flexible_space_robot"), sensors=False)
    for axis in "xyz":
        # 30 kg and 74 kg at up to 1 m/s: 100 N s, 1e3 N m s; the tolerance is that of the integration
        assert np.abs(recording[f"robot.linear_momentum.{axis}"]).max() < 1e-9 * 1e2
        assert np.abs(recording[f"robot.angular_momentum.{axis}"]).max() < 1e-8 * 1e3


@pytest.mark.proof
def test_passive_motion_follows_from_the_joints_alone() -> None:
    """Friction and control act at the joints: base and modes follow from the joint motion without them."""
    robot = load_robot("flexible_space_robot").with_effects(
        EffectUse(effect="viscous_friction", at="joint1", coefficient=20.0)
    )
    recording = simulate(robot, sensors=False)
    model = RobotModel(robot)
    q, qd, qdd = (
        np.column_stack([recording[f"{joint}.{quantity}"] for joint in model.joints])
        for quantity in ("position", "velocity", "acceleration")
    )
    base, inner = model.reconstruct_passive(recording.time, q, qd, qdd)
    assert base is not None
    assert inner is not None
    rates = np.column_stack([recording[f"base.angular_velocity.{axis}"] for axis in "xyz"])
    modal = np.column_stack([recording[f"link2.modal_coordinate.{k + 1}"] for k in range(4)])
    # interpolating the joint motion between samples errs by 1e-7 of the fast modes, less of all else
    assert np.abs(base.angular_velocity - rates).max() < 1e-7 * np.abs(rates).max()
    assert np.abs(inner.modal - modal).max() < 1e-6 * np.abs(modal).max()
    needed = model.inverse_dynamics(q, qd, qdd, base=base, inner=inner)[:, 6:8]
    acting = [recording[f"{j}.torque"] + recording[f"{j}.friction_torque"] for j in model.joints]
    assert np.abs(needed - np.column_stack(acting)).max() < 1e-4 * np.abs(acting).max()
