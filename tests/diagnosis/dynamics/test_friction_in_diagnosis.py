"""The diagnosis computes the friction of loaded bearings as the simulation does."""

from __future__ import annotations

import pytest

from missing_physics.diagnosis import Options, diagnose
from reference_model.simulation import simulate
from robot_model import EffectUse, Reference, Table, load_robot


@pytest.mark.proof
def test_lugre_friction_is_found_if_the_axis_often_rests() -> None:
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
    options = Options(experiments=False)
    found = diagnose(nominal, [simulate(nominal.with_effects(hidden), seed=1)], options=options).diagnosis
    assert [finding.effect for finding in found.findings] == ["lugre_friction"]
    for name, estimate in found.findings[0].parameters.items():
        low, high = estimate.ci95
        # Three standard deviations, as one of five 95 % intervals misses in a fifth of all recordings.
        assert abs(estimate.value - truth[name]) < 0.75 * (high - low), name
        assert estimate.value == pytest.approx(truth[name], rel=0.05), name
