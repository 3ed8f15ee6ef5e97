"""Contacts of a link with a wall, found from the joint torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from missing_physics.diagnosis import Options, diagnose
from missing_physics.hypotheses import Term
from missing_physics.inference.fit import of_one_fold
from missing_physics.inference.torques.columns import columns_of
from missing_physics.inference.torques.data import TorqueData
from missing_physics.standard import fit_standard
from reference_model.effects.body_force import BodySight
from reference_model.effects.catalogue import get_effect
from reference_model.effects.pushing import ForceAlong
from reference_model.effects.touching import walls
from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, load_robot

#: A level wall, 5 cm above the lowest place of the arm's tip.
WALL = {"stiffness": 2000.0, "offset": -0.5, "damping": 0.3, "x": 0.4, "normal_z": 1.0}


def with_wall(robot: Robot) -> Robot:
    return robot.with_effects(EffectUse.model_validate({"effect": "contact", "at": "link2", **WALL}))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("two_link_arm")


@pytest.fixture(scope="module")
def touching(robot: Robot) -> Recording:
    return simulate(
        robot.with_effects(EffectUse.model_validate({"effect": "contact", "at": "link2", **WALL}))
    )


@pytest.fixture
def swinging() -> tuple[RobotModel, tuple[np.ndarray, ...], BaseMotion]:
    """A free-flying arm whose base turns and whose joints swing."""
    model = RobotModel(load_robot("six_joint_space_arm"))
    time = np.arange(0.0, 2.0, 1e-3)
    rates = 1.0 + np.arange(len(model.joints))
    position = 0.4 * np.sin(time[:, None] * rates)
    velocity = 0.4 * rates * np.cos(time[:, None] * rates)
    half = 0.15 * time
    attitude = np.column_stack([np.cos(half), *np.sin(half) * np.array([[0.6], [0.0], [0.8]])])
    base = replace(
        BaseMotion.at_rest(attitude[0], time.size),
        attitude=attitude,
        angular_velocity=np.tile([0.18, 0.0, 0.24], (time.size, 1)),
    )
    return model, (time, position, velocity), base


def test_body_positions_are_consistent_with_body_velocities(
    swinging: tuple[RobotModel, tuple[np.ndarray, ...], BaseMotion],
) -> None:
    model, (time, position, velocity), base = swinging
    motion, _ = model.body_motion("link6", time, position, velocity, base=base)
    step = time[1] - time[0]
    moved = np.gradient(motion.position, step, axis=0)
    inertial = np.einsum("kij,kj->ki", motion.rotation, motion.velocity[:, :3])
    # second-order differences of motions of up to 6 rad/s
    assert moved[1:-1] == pytest.approx(inertial[1:-1], abs=2e-5)
    turned = np.gradient(motion.rotation, step, axis=0)
    spin = np.einsum("kji,kjl->kil", motion.rotation, turned)[1:-1]
    rates = np.column_stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]])
    assert rates == pytest.approx(motion.velocity[1:-1, 3:], abs=2e-4)


def test_generalised_forces_of_a_wrench_have_the_power_of_the_wrench(
    swinging: tuple[RobotModel, tuple[np.ndarray, ...], BaseMotion],
) -> None:
    model, (time, position, velocity), base = swinging
    motion, spread = model.body_motion("link4", time, position, velocity, base=base)
    wrench = np.random.default_rng(3).normal(size=(time.size, 6))
    rates = np.column_stack([base.linear_velocity, base.angular_velocity, velocity])
    power = np.einsum("kri,ki,kr->k", spread, wrench, rates)
    assert power == pytest.approx(np.sum(wrench * motion.velocity, axis=1), rel=1e-11, abs=1e-12)


def test_contact_columns_equal_the_change_of_torque_in_simulation(robot: Robot, touching: Recording) -> None:
    data = TorqueData.of(fit_standard(robot, [touching]), [touching], [touching])
    run, effect = data.runs[0], get_effect("contact")
    found = columns_of(Term.of(effect, "link2", WALL), run, 0)
    counted = run.rows.counted
    gap = np.where(counted, data.target(0) - data.nominal(0), 0.0)
    left = np.where(counted, gap - found[:, :, 0], 0.0)
    assert np.abs(gap).max() > 5.0
    # the wall's force is bent where it begins, which filters of motion and torque smooth differently
    assert np.sqrt(np.mean(left**2)) < 0.05 * np.sqrt(np.mean(gap**2))


def test_wall_position_is_the_position_of_first_contact() -> None:
    random = np.random.default_rng(5)
    count, normal, point, offset = 900, np.array([0.0, 1.0, 0.0]), np.array([0.3, 0.0, 0.1]), -0.1
    time = np.linspace(0.0, 20.0, count)
    place = 0.3 * np.sin(time[:, None] * np.array([0.9, 1.3, 0.7]) + np.array([0.0, 1.0, 2.0]))
    turned = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turned *= np.linalg.det(turned)
    rotation = np.broadcast_to(turned, (count, 3, 3))
    spread = random.normal(size=(count, 4, 6))
    height = (place + rotation @ point) @ normal
    force = 500.0 * np.maximum(offset - height, 0.0) ** 1.5
    pushed = turned.T @ normal
    along = np.tile(np.concatenate([pushed, np.cross(point, pushed)]), (count, 1))
    left = np.einsum("kni,ki->kn", spread, along) * force[:, None] + 1e-3 * random.normal(size=(count, 4))
    sight = BodySight(place, rotation, spread, left, np.array([np.zeros(3), point]))
    share, best = walls(sight, 1.5)[0]
    assert share > 0.95
    assert [best[name] for name in ("x", "y", "z")] == pytest.approx(point.tolist())
    assert [best[f"normal_{axis}"] for axis in "xyz"] == pytest.approx(normal.tolist(), abs=0.05)
    assert best["offset"] == pytest.approx(offset, abs=0.03)  # places are 5 to 15 % of the depth apart
    assert walls(BodySight(place, rotation, spread, 0.0 * left, sight.points), 1.5) == ()


@pytest.mark.parametrize(("shares", "once"), [([0.2, 0.3, 0.5], False), ([0.1, 0.3, 0.6], True)])
def test_parameters_determined_by_one_fold_only_are_detected(shares: list[float], once: bool) -> None:
    information = np.array(shares)[:, None] * np.array([1.0, 1e6])
    assert of_one_fold(information).any() == once


def test_contact_with_a_wall_is_named_with_its_position(robot: Robot, touching: Recording) -> None:
    result = diagnose(robot, [touching], options=Options(experiments=False))
    (finding,) = result.diagnosis.findings
    assert (finding.effect, finding.location, finding.ambiguous_with) == ("contact", "link2", ())
    # filters of the motion smooth where the force begins: a little more than noise makes
    assert finding.parameters["offset"].value == pytest.approx(WALL["offset"], abs=5e-3)
    assert finding.parameters["stiffness"].value == pytest.approx(WALL["stiffness"], rel=0.05)
    assert finding.parameters["x"].value == pytest.approx(WALL["x"], abs=5e-3)


def test_derivatives_of_a_contact_wrench_equal_finite_differences(robot: Robot, touching: Recording) -> None:
    run = TorqueData.of(fit_standard(robot, [touching]), [touching], [touching]).runs[0]
    along, (signals, _) = ForceAlong(get_effect("contact"), robot), run.body("link2")
    slopes = along.slopes(signals, WALL, ["stiffness", "offset", "x"])
    for name, step, slope in zip(("stiffness", "offset", "x"), (1.0, 1e-6, 1e-6), slopes.transpose(2, 0, 1)):
        up, down = (along.wrench(signals, {**WALL, name: WALL[name] + s}) for s in (step, -step))
        found = (up - down) / (2.0 * step)
        assert np.abs(found).max() > 0.0
        # the second derivative of the force is infinite where it begins
        assert slope == pytest.approx(found, rel=1e-3, abs=1e-3 * float(np.abs(found).max()))


def test_wall_in_the_robot_file_is_not_a_finding(robot: Robot, touching: Recording) -> None:
    result = diagnose(with_wall(robot), [touching], options=Options(experiments=False))
    assert (result.diagnosis.verdict, result.diagnosis.findings) == ("consistent", ())
