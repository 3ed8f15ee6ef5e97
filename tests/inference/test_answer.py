"""Answers of a diagnosis for recordings with known parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recorded_arm import COULOMB, VISCOUS, Hidden, asymmetric, nothing, recorded, spring

from missing_physics.answer.guard import guarded
from missing_physics.answer.unnamed import unnamed
from missing_physics.diagnosis import diagnose
from missing_physics.evaluation import evaluate
from missing_physics.hypotheses import Hypothesis, Term
from missing_physics.inference import Fit, fitted, search, weighed
from missing_physics.inference.torques.data import TorqueData
from missing_physics.reporting.elements.curves import drawn
from missing_physics.results.result import Result
from missing_physics.standard import fit_standard
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Recording, Robot, robot_from_toml


def with_friction(arm: Robot, factor: float = 1.0) -> Robot:
    """The arm as it is, with its friction in the file times a factor."""
    return arm.with_effects(
        EffectUse(effect="viscous_friction", at="joint", coefficient=factor * VISCOUS),
        EffectUse(effect="coulomb_friction", at="joint", torque=factor * COULOMB),
    )


def diagnosed(robot: Robot, hidden: Hidden) -> tuple[Result, list[Recording]]:
    runs = [recorded(hidden, seed=1), recorded(hidden, seed=2)]
    return diagnose(robot, runs[:1], runs[1:]), runs


def thinning(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Drag of a fluid that thins as it is sheared, which no effect of the catalogue is."""
    return 0.5 * np.arctan(2.0 * velocity)


def test_offset_smaller_than_friction_is_ambiguous_with_asymmetric_friction(arm: Robot) -> None:
    """Friction of 0.7 and 0.3 N m is one of 0.5 with an offset of 0.2, or with one of the torque sensor."""
    result, _ = diagnosed(with_friction(arm), lambda time, position, velocity: np.full_like(time, 0.2))
    (finding,) = result.diagnosis.findings
    names = {"torque_offset", "asymmetric_friction", "sensor_offset@joint.torque"}
    assert {finding.effect, *finding.ambiguous_with} == names
    (size,) = [e.value for e in finding.parameters.values() if abs(e.value) > 0.1]
    assert abs(size) == pytest.approx(0.2, rel=0.01)  # noise of one sample


def test_offset_of_the_actuator_is_as_probable_as_one_of_the_torque_sensor(arm: Robot) -> None:
    """Recorded and needed torque differ by the same constant in both cases."""
    result, _ = diagnosed(with_friction(arm), lambda time, position, velocity: np.full_like(time, 2.0))
    (finding,) = result.diagnosis.findings
    assert finding.effect == "torque_offset"
    assert finding.ambiguous_with == ("sensor_offset@joint.torque",)
    assert 0.3 < finding.probability < 0.5
    assert result.diagnosis.verdict == "ambiguous"


@pytest.mark.parametrize("factor", [1.0, 0.95])  # files are good to some percent
def test_robot_file_with_errors_of_a_few_percent_is_consistent(arm: Robot, factor: float) -> None:
    result, _ = diagnosed(with_friction(arm, factor), nothing)
    assert result.diagnosis.findings == ()


def test_recording_explained_up_to_noise_is_consistent(arm: Robot) -> None:
    result, _ = diagnosed(with_friction(arm), nothing)
    assert result.diagnosis.verdict == "consistent"


def test_friction_missing_in_the_robot_file_is_named_with_its_size(arm: Robot) -> None:
    result, _ = diagnosed(arm, nothing)
    found = {f.effect: f for f in result.diagnosis.findings}
    assert set(found) == {"viscous_friction", "coulomb_friction"}
    for effect, name, true in (
        ("viscous_friction", "coefficient", VISCOUS),
        ("coulomb_friction", "torque", COULOMB),
    ):
        estimate = found[effect].parameters[name]
        # Half a percent: the sign at a reversal, which the band's filter smears.
        assert estimate.value == pytest.approx(true, rel=5e-3)
        assert found[effect].probability > 0.85


@pytest.mark.parametrize(
    ("hidden", "effect"), [(spring, "cable_spring"), (asymmetric, "asymmetric_friction")]
)
def test_with_a_correct_robot_file_only_the_hidden_effect_is_named(
    arm: Robot, hidden: Hidden, effect: str
) -> None:
    result, _ = diagnosed(with_friction(arm), hidden)
    diagnosis = result.diagnosis
    assert [f.effect for f in diagnosis.findings] == [effect]
    assert diagnosis.verdict == "explained"
    assert [m.location for m in diagnosis.mismatch] == ["joint"]
    assert diagnosis.fit.validation_improvement > 0.8


def test_residual_of_the_robot_file_equals_the_stated_one(arm: Robot) -> None:
    result, runs = diagnosed(with_friction(arm), spring)
    written, diagnosis = robot_from_toml(result.augmented_robot_toml), result.diagnosis
    channel = diagnosis.fit.channels["joint.torque"]
    made = evaluate(written, runs[1], diagnosis.fit.bands[1])
    (rows,) = [s for s in result.series if s.role == "validation"]
    left = made.at(rows.time, "joint.torque")[rows.counted]
    # Recordings are compared with the small delay of the torque taken out, which is a tenth of a sample here.
    assert np.sqrt(np.mean(left**2)) == pytest.approx(channel.after.validation_rms, rel=0.02)
    assert channel.standard is not None
    assert channel.after.validation_rms < 0.5 * channel.standard.validation_rms


def test_unknown_force_is_reported_without_a_name(arm: Robot) -> None:
    result, _ = diagnosed(with_friction(arm), thinning)
    diagnosis = result.diagnosis
    assert diagnosis.findings == ()
    (force,) = diagnosis.unnamed
    assert force.depends_on == ("joint.velocity",)
    assert force.share > 0.8
    assert diagnosis.verdict == "unexplained"


def test_friction_that_decreases_with_time_is_described_without_a_name(arm: Robot) -> None:
    def warming(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        return 0.4 * np.exp(-time / 6.0) * np.sign(velocity)

    diagnosis = diagnosed(with_friction(arm), warming)[0].diagnosis
    assert diagnosis.findings == ()
    (force,) = diagnosis.unnamed
    (curve,), (knots,) = force.curves, force.knots
    assert (force.depends_on, curve.carrier) == (("time",), "direction")
    assert force.share > 0.8
    assert "a curve over time times the direction of motion" in force.words
    early, late = (np.interp(t, knots, curve.torque) for t in (1.0, 20.0))
    # of a polynomial of the fourth degree
    assert early - late == pytest.approx(0.4 * (np.exp(-1.0 / 6.0) - np.exp(-20.0 / 6.0)), rel=0.1)
    assert diagnosis.verdict == "unexplained"
    assert drawn(force, arm).across == "time [s]"


def test_force_contradicted_by_held_out_data_is_not_reported(arm: Robot) -> None:
    def bump(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        return 0.8 * np.exp(-8.0 * (position - 0.3) ** 2)

    def hollow(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        return -bump(time, position, velocity)

    robot, fit = with_friction(arm), recorded(bump, seed=1)
    standard = fit_standard(robot, [fit])
    same, other = (TorqueData.of(standard, [fit], [recorded(hidden, seed=2)]) for hidden in (bump, hollow))
    hypothesis = weighed(search(same)).answer.hypothesis
    (force,) = unnamed(same, fitted(same, hypothesis))
    assert force.depends_on == ("joint.position",)
    assert list(unnamed(other, fitted(other, hypothesis))) == []


def test_a_quarter_of_a_single_recording_is_held_out(arm: Robot) -> None:
    result = diagnose(with_friction(arm), [recorded(spring, seed=1, duration=48.0)])
    (series,) = result.series
    assert np.mean(series.held_out) == pytest.approx(0.25, abs=0.03)
    assert [f.effect for f in result.diagnosis.findings] == ["cable_spring"]


def test_the_same_recordings_give_the_same_file(arm: Robot) -> None:
    first, second = (diagnosed(with_friction(arm), spring)[0].diagnosis.to_json() for _ in range(2))
    assert first == second


def test_joint_predicted_better_by_the_robot_file_keeps_its_parameters(arm: Robot) -> None:
    """A spring of the fitted recording alone, beside bodies that are known."""
    robot = with_friction(arm)
    runs = recorded(spring, seed=1), recorded(nothing, seed=2)
    data = TorqueData.of(fit_standard(robot, runs[:1]), runs[:1], runs[1:])
    bodies = data.layout.bodies[0]
    known = Hypothesis().holding(dict(zip(data.layout.names[bodies], data.file_values[bodies])))
    start = Term.of(get_effect("cable_spring"), "joint", {"stiffness": 0.0, "torque_at_zero": 0.0})
    standard, answer = fitted(data, known), fitted(data, replace(known, terms=(start,)))
    unseen, least = ~data.fitted_blocks, np.hypot(data.noise[0], data.error[0])

    def left(fit: Fit) -> float:
        return float(np.sqrt(fit.errors[unseen].sum() / data.counts[unseen].sum()))

    safe = guarded(data, answer, standard)
    assert min(left(answer), left(standard)) > 10.0 * least
    assert not safe.file.hypothesis.terms
    # The file is exact but for a delay, which the spring's torque in the fitted recording pretends.
    assert left(safe.file) < 3.0 * least
