"""The diagnosis computes the friction of loaded bearings as the simulation does."""

from __future__ import annotations

import numpy as np
import pytest

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.terms.term import Place, Term, joint_torque
from reference_model.effects.base import JointSignals
from reference_model.effects.catalogue import get_effect
from reference_model.evaluation.model import RobotModel
from reference_model.plant.acting import TRANSITION
from reference_model.simulation import simulate
from robot_model import EffectUse, Reference, Robot, Table, load_robot


def _robot() -> Robot:
    data = load_robot("six_joint_space_arm").model_dump()
    data["reference"]["duration"], data["reference"]["sample_rate"] = 1.0, 100.0
    data["base"]["kind"] = "fixed"
    for joint in data["joints"]:
        joint["bearing"] = {"radial_arm": 0.05, "axial_arm": 0.04, "span": 0.2}
        joint["initial_velocity"] = 0.3
    use = EffectUse.model_validate(
        {
            "effect": "stribeck_friction",
            "at": "joint2",
            "coulomb_torque": 0.2,
            "static_torque": 0.3,
            "stribeck_velocity": 0.05,
            "load_coefficient": 0.1,
            "load_static_coefficient": 0.15,
            "gear_share": 0.02,
        }
    )
    return Robot.model_validate(data | {"effects": (use,)})


def test_the_load_of_two_bearings_is_the_simulated_one() -> None:
    robot = _robot()
    recording = simulate(robot, sensors=False)
    names = [joint.name for joint in robot.moving_joints]
    motion = [
        np.stack([recording[f"{name}.{key}"] for name in names], axis=1)
        for key in ("position", "velocity", "acceleration")
    ]
    model = RobotModel(robot)
    loads = model.bearing_loads(*motion)[:, names.index("joint2")]
    signals = np.zeros((len(recording), len(JointSignals.CHANNELS)))
    first = JointSignals.CHANNELS.index("radial_force")
    signals[:, first : first + loads.shape[1]] = loads
    for name in ("velocity", "torque"):
        signals[:, JointSignals.CHANNELS.index(name)] = recording[f"joint2.{name}"]
    (use,) = robot.effects
    effect = get_effect(use.effect)
    term = Term(effect, use.at, {**effect.defaults(), **use.parameters})
    torque, jacobian = joint_torque(term, Place.of(robot.joint("joint2"), TRANSITION), signals)
    assert np.ptp(recording["joint2.friction_torque"]) > 0.1
    assert jacobian.shape[1] == 3
    # The same expressions at the same state: rounding.
    np.testing.assert_allclose(torque, recording["joint2.friction_torque"], atol=1e-10)


@pytest.mark.proof
def test_bristles_are_found_where_the_axis_often_rests() -> None:
    """Slow speeds among the rests are no measure of the Stribeck velocity: other starts have to be tried."""
    times, positions = [0.0, 0.5], [0.0, 0.0]
    for goal in (-0.015, -0.026, -0.044, -0.026, -0.045, 0.016, -0.007):
        times += [times[-1] + 1.9, times[-1] + 2.3]
        positions += [goal, goal]
    table = Table(joint="joint1", kind="table", times=tuple(times), positions=tuple(positions))
    reference = Reference(duration=times[-1], sample_rate=500.0, joints=(table,))
    robot = load_robot("single_axis")
    viscous = tuple(use for use in robot.effects if use.effect == "viscous_friction")
    nominal = robot.model_copy(update={"reference": reference, "effects": viscous})
    truth = {
        **{"coulomb_torque": 16.8, "static_torque": 26.7, "stribeck_velocity": 0.0052},
        **{"bristle_stiffness": 2.14e5, "bristle_damping": 2500.0},
    }
    hidden = EffectUse.model_validate({"effect": "lugre_friction", "at": "joint1", **truth})
    options = Options(experiments=False, simulation=False)
    found = diagnose(nominal, [simulate(nominal.with_effects(hidden), seed=1)], options=options).diagnosis
    assert [finding.effect for finding in found.findings] == ["lugre_friction"]
    for name, estimate in found.findings[0].parameters.items():
        # The intervals are for noise; one in a hundred may come from the smoothing of the motion.
        assert estimate.value == pytest.approx(truth[name], rel=0.01), name
