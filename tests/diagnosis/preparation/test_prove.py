"""Proof on data that were not fitted, and what is done where these do not show the effect."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import ARM, Sines, bare, plain_view, problem_of, recorded, term

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.least_squares.explanation import explain
from missing_physics.diagnosis.preparation.proof import HeldOut
from robot_model import Recording, Robot

STOP, STIFFNESS = 0.27, 2e4
WIDE = (Sines((0.06, 0.035, 0.012), (0.15, 0.37, 0.83), (0.0, 1.3, 2.1), centre=0.2),)
NARROW = (Sines((0.02, 0.015, 0.01), (0.17, 0.41, 0.77), (0.4, 0.9, 0.1), centre=0.19),)


def _stopped(robot: Robot, motions: tuple[Sines, ...], seed: int) -> Recording:
    return recorded(
        robot, motions, lambda t, q, qd, qdd: STIFFNESS * np.maximum(q - STOP, 0), duration=24.0, seed=seed
    )


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.proof)])
def test_an_effect_that_the_held_out_motion_never_meets_is_proven_where_it_acts(seed: int) -> None:
    robot = bare("single_axis", noise=True)
    options = Options(experiments=False, simulation=False)
    result = diagnose(
        robot, [_stopped(robot, WIDE, seed)], [_stopped(robot, NARROW, seed + 10)], options=options
    )
    found = result.diagnosis
    assert found.verdict == "explained"
    assert [(f.effect, f.location) for f in found.findings] == [("end_stop", "joint1")]
    low, high = found.findings[0].parameters["position"].ci95
    assert low <= STOP <= high
    assert any("does not act in the held-out data" in sentence for sentence in found.could_not_tell)
    # Nothing is claimed of data that the motion did not show.
    assert abs(found.fit.validation_improvement) < 0.02  # noise of the two fits


@pytest.mark.proof
def test_what_only_the_held_out_recording_shows_is_no_agreement() -> None:
    robot = bare("single_axis", noise=True)
    options = Options(experiments=False, simulation=False)
    fitted, held_out = _stopped(robot, NARROW, 3), _stopped(robot, WIDE, 4)
    found = diagnose(robot, [fitted], [held_out], options=options).diagnosis
    assert (found.verdict, found.findings) == ("unexplained", ())
    assert "in the held-out recording" in found.mismatch[0].words
    # Both recordings without the stop agree.
    other = recorded(robot, WIDE, duration=24.0, seed=5)
    assert diagnose(robot, [fitted], [other], options=options).diagnosis.verdict == "consistent"


def test_errors_of_another_joint_do_not_drown_the_proof() -> None:
    """Held-out data in which joint2 is off by a hundred times what joint1's friction does."""
    robot = bare("two_link_arm", noise=True)
    chance = np.random.default_rng(3)

    def rubbing(level: float, wrong: float) -> Recording:
        def extra(time: np.ndarray, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
            return np.column_stack([level * np.sign(qd[:, 0]), wrong * chance.standard_normal(len(time))])

        return recorded(robot, ARM, extra, duration=16.0, seed=1)

    problem = problem_of(robot, rubbing(0.3, 0.0))
    view = plain_view(problem)
    nothing = explain(problem, view, (), nuisance=False)
    friction = explain(problem, view, [term("coulomb_friction", "joint1", torque=0.1)], nuisance=False)
    for level, confirmed in ((0.3, True), (0.0, False)):
        other = problem_of(robot, rubbing(level, 100.0))
        held_out = HeldOut(other, np.ones(other.time.size, dtype=bool), np.ones(2))
        assert (held_out.refusal(nothing, friction) == "") is confirmed
        assert list(held_out.acts(friction, friction.terms)) == [True, False]
    assert held_out.acts(nothing, ()).all()
