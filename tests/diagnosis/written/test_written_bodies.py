"""Bodies of the robot file need the torques by which errors are stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import ARM, bare, recorded, term
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.preparation.setup import InertialBasis, inertial_basis, make_segments
from missing_physics.diagnosis.preparation.split import Split, split
from missing_physics.diagnosis.runs.torque_scores import TorqueScores
from missing_physics.diagnosis.written import statement
from missing_physics.diagnosis.written.augment import augmented_robot, with_inertial, with_masses
from missing_physics.diagnosis.written.bodies import NEAREST, NOT_REAL, with_bodies_of
from missing_physics.diagnosis.written.statement import stated
from missing_physics.evaluation import Band, evaluate
from robot_model import Recording, Robot

Array = NDArray[np.float64]

ROBOT = bare("two_link_arm", noise=True)


def other_arm(*, rotor: float = 0.0, mass: float = 0.0) -> Robot:
    """The arm with more inertia of its first motor at the joint [kg m^2] and mass of its second link [kg]."""
    first, second = ROBOT.joints
    assert first.actuator is not None
    more = first.actuator.rotor_inertia + rotor / first.actuator.gear_ratio**2
    actuator = first.actuator.model_copy(update={"rotor_inertia": more})
    link = ROBOT.links[1].model_copy(update={"mass": ROBOT.links[1].mass + mass})
    joints = (first.model_copy(update={"actuator": actuator}), second)
    return ROBOT.model_copy(update={"joints": joints, "links": (ROBOT.links[0], link)})


def fitted(real: Robot, *, duration: float) -> tuple[Recording, InertialBasis, Split, Explanation]:
    """Viscous friction and inertial numbers of the arm; the recording has a ripple of 1 N m as well."""

    def extra(time: Array, q: Array, qd: Array, qdd: Array) -> Array:
        return np.asarray((1.5 * qd + np.sin(9.0 * q)) * [1.0, 0.0])

    made = recorded(real, ARM, extra, duration=duration, seed=6)
    segments = make_segments(ROBOT, [made])
    basis = inertial_basis(ROBOT, segments)
    data = split(segments, 1, basis, seed=0)
    friction = term("viscous_friction", "joint1", coefficient=0.0)
    return made, basis, data, explain(data.problem, data.view, [friction])


def errors_of(robot: Robot, recording: Recording, data: Split) -> Array:
    """What a robot file leaves of both torques at the samples of the fit, rms."""
    motion = data.segments[0].motion
    found = evaluate(robot, recording, Band(motion.low_pass.cutoff, motion.motion_cutoff))
    left = [found.at(data.problem.time, f"{name}.torque") for name in data.problem.joints]
    return np.asarray(np.sqrt(np.mean(np.square(left), axis=1)))


def test_masses_that_chance_might_explain_are_written_as_they_are_stated() -> None:
    """Four seconds and a ripple do not prove that a rotor is heavier, but the stated errors have it."""
    made, basis, data, found = fitted(other_arm(rotor=0.1), duration=4.0)
    left = np.sqrt(np.mean(found.residual**2, axis=0))
    file = augmented_robot(ROBOT, found.terms)
    kept, _ = with_masses(file, basis, found)
    assert kept.joints == ROBOT.joints
    assert errors_of(kept, made, data)[0] > 1.2 * left[0]
    written, remark = with_bodies_of(file, basis, data, found)
    assert not remark
    # A percent: the evaluation leaves out what lies about reversals, which the fit does not.
    np.testing.assert_allclose(errors_of(written, made, data), left, rtol=1e-2)


def test_bodies_that_cannot_be_give_way_to_those_that_predict_the_same() -> None:
    """The change of fewest numbers takes from a lighter link more inertia than it has."""
    made, basis, data, found = fitted(other_arm(mass=-0.6 * ROBOT.links[1].mass), duration=8.0)
    left = np.sqrt(np.mean(found.residual**2, axis=0))
    file = augmented_robot(ROBOT, found.terms)
    assert with_inertial(file, basis.names, basis.directions @ found.nuisance)[1]
    written, remark = with_bodies_of(file, basis, data, found)
    assert not remark
    assert Robot.model_validate(written.model_dump(mode="python")) == written
    np.testing.assert_allclose(errors_of(written, made, data), left, rtol=1e-2)


@pytest.mark.parametrize("factor", [30.0, -30.0])
def test_where_no_bodies_do_what_was_fitted_the_file_is_one_of_real_bodies_all_the_same(
    factor: float,
) -> None:
    _, basis, data, found = fitted(other_arm(mass=1.0), duration=4.0)
    astray = replace(found, nuisance=factor * found.nuisance)
    written, remark = with_bodies_of(augmented_robot(ROBOT, found.terms), basis, data, astray)
    assert remark in ((NEAREST, NOT_REAL) if factor < 0 else ("",))
    assert Robot.model_validate(written.model_dump(mode="python")) == written


def test_stated_errors_are_those_of_the_file_where_it_differs_from_the_fit() -> None:
    """A file that lacks the fit's rotor: its own errors are told and drawn, fitted and held out."""
    made, _, data, found = fitted(other_arm(rotor=0.1), duration=4.0)
    scores = TorqueScores(ROBOT, data, data)
    untouched = explain(data.problem, data.view, [], nuisance=False)
    fit, _ = scores.fit(untouched, found)
    series = scores.series(untouched, found)
    lacking = augmented_robot(ROBOT, found.terms)
    told, drawn = stated(lacking, ([made], (), data.segments), fit, series)
    before, after = fit.channels["joint1.torque"], told.channels["joint1.torque"]
    assert after.after.train_rms > 1.1 * before.after.train_rms
    assert (after.before, after.noise_floor) == (before.before, before.noise_floor)
    one = next(s for s in drawn if s.channel == "joint1.torque")
    assert one.counted is not None
    left, rows = one.measured - one.augmented, one.held_out & one.counted
    assert after.after.validation_rms == pytest.approx(float(np.sqrt(np.mean(left[rows] ** 2))))
    assert after.relative_error_after is not None
    assert after.relative_error_after.validation_rms == pytest.approx(
        float(np.sqrt(np.mean(left[one.held_out] ** 2) / np.mean(one.measured[one.held_out] ** 2)))
    )
    assert told.validation_improvement < fit.validation_improvement
    assert told.bands == (
        Band(data.segments[0].motion.low_pass.cutoff, data.segments[0].motion.motion_cutoff),
    )
    motion = data.segments[0].motion
    evaluated = evaluate(lacking, made, Band(motion.low_pass.cutoff, motion.motion_cutoff))
    np.testing.assert_allclose(left, evaluated.at(one.time, "joint1.torque"), atol=1e-12)


def test_a_file_held_against_smoothed_motions_leaves_what_it_leaves_along_the_recorded_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where links bend their smoothed motion is taken; of an arm that does not, both ways give the same."""
    made, basis, data, found = fitted(other_arm(rotor=0.1), duration=4.0)
    scores = TorqueScores(ROBOT, data, data)
    untouched = explain(data.problem, data.view, [], nuisance=False)
    fit, series = scores.fit(untouched, found)[0], scores.series(untouched, found)
    written, _ = with_bodies_of(augmented_robot(ROBOT, found.terms), basis, data, found)
    along, _ = stated(written, ([made], (), data.segments), fit, series)
    monkeypatch.setattr(statement, "_follows", lambda segments: False)
    assert stated(written, ([made], (), data.segments), fit, series) == (fit, series)
    smoothed, _ = stated(written, ([made], (), data.segments), fit, series, otherwise=True)
    for channel, errors in along.channels.items():
        other = smoothed.channels[channel].after
        assert other.validation_rms == pytest.approx(errors.after.validation_rms, rel=1e-3)
        assert other.train_rms == pytest.approx(errors.after.train_rms, rel=1e-3)
    assert along.bands
    assert not smoothed.bands
