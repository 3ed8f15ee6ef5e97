"""Explanations that do the same in the data are all told, with probabilities that share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import term
from end_to_end_cases import ARM, AXIS, QUICK

from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.naming.judge import RICHER, _counted
from missing_physics.results.result import Finding
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot

DRY_ARM = ARM.with_effects(EffectUse(effect="coulomb_friction", at="joint1", torque=2.0))
#: Without friction a gain scales the inertia alone.
SMOOTH_AXIS = AXIS.model_copy(update={"effects": ()})


def told(robot: Robot, *hidden: EffectUse) -> list[Finding]:
    made = simulate(robot.with_effects(*hidden), seed=1)
    return list(diagnose(robot, [made], options=QUICK).diagnosis.findings)


def names(finding: Finding) -> set[str]:
    return {f"{finding.effect}@{finding.location}", *finding.ambiguous_with}


@pytest.mark.proof
@pytest.mark.parametrize(
    ("robot", "difference"),
    [(DRY_ARM, 0.5), (AXIS, 2.0)],
    ids=["arm", "axis"],
)
def test_a_difference_of_coulomb_friction_between_directions_and_an_offset_are_reported_together(
    robot: Robot, difference: float
) -> None:
    """In rows of sure direction they are one column; what the filter brings of others moves evidence by 1.

    Of three on the arm, runs in closed loop tell the sensor's offset from them.
    """
    uneven = {"coulomb_difference": difference, "viscous_difference": 0.0}
    [finding] = told(robot, EffectUse(effect="asymmetric_friction", at="joint1", **uneven))
    assert {"asymmetric_friction@joint1", "torque_offset@joint1"} <= names(finding)
    chances = [finding.probability, *(a.probability for a in finding.alternatives)]
    kin = chances[: len(finding.ambiguous_with) + 1]
    assert max(kin) < np.e * min(p for p in kin if p >= 0.05)


@pytest.mark.proof
def test_a_wrong_inertia_that_a_point_mass_makes_as_well_is_reported_beside_it() -> None:
    """Joint 1 feels two numbers of link 1, and a mass at a place along it has two."""
    wrong = EffectUse.model_validate(
        {"effect": "inertia", "at": "link1", "first_moment_x": 0.2, "inertia_yy": 0.05, "inertia_zz": 0.05}
    )
    [finding] = told(ARM, wrong)
    assert names(finding) == {"inertia@link1", "payload@link1"}
    assert finding.probability == pytest.approx(0.5, abs=0.1)


@pytest.mark.proof
def test_a_gain_and_a_mass_are_not_reported_as_three_changes() -> None:
    """A gain of the encoder explains most of both and came in first, friction and mass after it."""
    gain = EffectUse(effect="torque_gain", at="joint1", gain_error=0.04)
    heavier = EffectUse.model_validate({"effect": "inertia", "at": "carriage", "mass": 8.0})
    sets = [names(finding) for finding in told(AXIS, gain, heavier)]
    assert {"payload@carriage", "inertia@carriage"} in sets
    assert {"torque_gain@joint1"} in sets
    assert len(sets) == 2


def test_no_drive_that_delivers_a_tenth_to_a_tenth_of_the_mass_is_named() -> None:
    """It would do all that the robot does with a tenth of the errors."""
    heavier = EffectUse.model_validate({"effect": "inertia", "at": "carriage", "mass": 3.0})
    for finding in told(SMOOTH_AXIS, heavier):
        assert all(abs(value.value) < 10.0 for value in finding.parameters.values())
        assert "gain_error" not in finding.parameters or finding.parameters["gain_error"].value > -0.5


def test_a_richer_rival_must_bring_something_for_what_it_can_do_beyond() -> None:
    offset = term("torque_offset", "joint1", torque=1.0)
    both = term("asymmetric_friction", "joint1", coulomb_difference=1.0, viscous_difference=0.5)
    one = replace(both, unseen=("viscous_difference",))
    assert _counted(52.0, offset, both) == pytest.approx(52.0 - RICHER)
    assert _counted(52.0, offset, one) == pytest.approx(52.0)
    assert _counted(52.0, both, offset) == pytest.approx(52.0)
