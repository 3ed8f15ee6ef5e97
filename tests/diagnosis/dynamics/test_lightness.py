"""How much inertia an explanation leaves, and refusals that rest on it."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import bare, term

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.dynamics.lightness import Lightness
from missing_physics.diagnosis.naming.search import cut_off
from missing_physics.diagnosis.preparation.setup import make_segments
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate
from robot_model import EffectUse, Quintic, Reference


@pytest.mark.parametrize("name", ["single_axis", "two_link_arm", "six_joint_space_arm"])
def test_numbers_of_a_part_leave_that_part(name: str) -> None:
    """With every mass and inertia times s, the joints of a fixed and of a free robot feel s of all."""
    robot = bare(name)
    assert robot.reference is not None
    short = robot.model_copy(update={"reference": robot.reference.model_copy(update={"duration": 2.0})})
    [segment] = make_segments(robot, [simulate(short)])
    names = segment.dynamics.model.inertial_names
    columns = np.array([k for k, number in enumerate(names) if not number.startswith("gravity")])
    whole = segment.dynamics.model.inertial[columns]
    lightness = Lightness(segment.dynamics, columns, whole[:, None])
    for part in (2.0, 0.5, 0.05, -0.5):
        assert lightness(np.array([part - 1.0])) == pytest.approx(part, rel=1e-6)
    assert lightness(np.zeros(1)) == 1.0


def test_no_actuator_that_lets_nothing_through_explains_a_motion_one_way() -> None:
    """A noisy axis that moved once, one way: no saturated motor is named.

    It would explain more of the noise than friction does, without the axis' mass.
    """
    robot = bare("single_axis", noise=True)
    quintic = Quintic(joint="joint1", displacement=0.3, start=0.5, duration=5.0)
    reference = Reference(duration=6.0, sample_rate=200.0, joints=(quintic,))
    robot = robot.model_copy(update={"reference": reference})
    truth = EffectUse(effect="coulomb_friction", at="joint1", torque=20.0)
    found = diagnose(
        robot,
        [simulate(robot.with_effects(truth), seed=10162)],
        options=Options(simulation=False, experiments=False),
    )
    [finding] = found.diagnosis.findings
    assert "coulomb_friction@joint1" in {f"{finding.effect}@{finding.location}", *finding.ambiguous_with}
    refused = {(rung.effect, rung.why) for rung in found.ladder if not rung.kept}
    assert ("torque_saturation", "it needs a robot with next to no inertia") in refused


def test_a_size_at_the_end_of_its_range_is_cut_off() -> None:
    """But not one that is absent there, nor an order, which is no size."""
    lower = get_effect("sensor_gain").parameter("gain_error").lower
    assert "gain_error" in cut_off(term("sensor_gain", "joint1.position", gain_error=lower))
    assert not cut_off(term("sensor_gain", "joint1.position", gain_error=0.5 * lower))
    assert not cut_off(term("coulomb_friction", "joint1", torque=0.0))
    highest = get_effect("torque_ripple").parameter("order").upper
    assert not cut_off(term("torque_ripple", "joint1", sine=1.0, cosine=0.0, order=highest))
