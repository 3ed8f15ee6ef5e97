"""Nominal robot, standard model and answer are compared alike; the better file is written."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from missing_physics.diagnosis.comparison.choice import chosen
from missing_physics.diagnosis.comparison.predictions import Predictions, predictions
from missing_physics.diagnosis.comparison.stage import compared, judged, not_judged
from missing_physics.evaluation import Band
from missing_physics.results.result import ChannelFit, Diagnosis, Errors, Finding, Fit, Result
from missing_physics.results.samples import Rows
from missing_physics.standard import fit_standard
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, Recording, Robot, load_robot, robot_from_toml, robot_to_toml

ARM = load_robot("two_link_arm").model_copy(update={"effects": ()})
JOINTS = [joint.name for joint in ARM.moving_joints]
CHANNELS = tuple(f"{joint}.torque" for joint in JOINTS)


def friction(torque: float, at: str = "joint1") -> EffectUse:
    return EffectUse(effect="coulomb_friction", at=at, **{"torque": torque})


MACHINE = ARM.with_effects(friction(3.0))
BAND = Band(torque=8.0, motion=40.0)


def recorded(robot: Robot = MACHINE, *, without: tuple[str, ...] = ()) -> Recording:
    assert robot.reference is not None
    short = robot.reference.model_copy(update={"duration": 8.0, "sample_rate": 250.0})
    run = simulate(robot.model_copy(update={"reference": short}), seed=3)
    names = [f"{joint}.{what}" for joint in JOINTS for what in ("position", "torque")]
    return Recording(run.time, {n: run[n] for n in names if n not in without}, "simulated")


@pytest.fixture(scope="module")
def run() -> Recording:
    return recorded()


def rows(recording: Recording, channels: tuple[str, ...] = CHANNELS) -> tuple[Rows]:
    time = np.arange(1.0, 7.0, 0.03)
    held = (time > 3.0) & (time < 4.5)
    counted = np.ones((time.size, len(channels)), dtype=bool)
    return (Rows(channels, np.full(len(channels), 0.02), time, held, counted, BAND),)


def diagnosed(answer: Robot, own: tuple[Rows, ...], *findings: Finding) -> Result:
    nothing = Errors(1.0, 1.0)
    fit = Fit({c: ChannelFit("N m", nothing, nothing, 0.02) for c in own[0].channels}, 0.0)
    diagnosis = Diagnosis("arm", ("simulated",), (), "explained", "", (), findings, fit)
    return Result(diagnosis, (), (), robot_to_toml(answer), rows=own)


def test_correct_answer_is_written_next_to_the_standard_model(run: Recording) -> None:
    result = compared(diagnosed(MACHINE, rows(run)), ARM, [run], 1)
    found = result.diagnosis
    assert found.comparison.written == "answer"
    joint = found.comparison.channels["joint1.torque"]
    assert joint.standard is not None
    assert joint.answer.validation_rms < 0.2 * joint.nominal.validation_rms
    assert joint.standard.validation_rms < 0.3 * joint.nominal.validation_rms
    assert joint.answer.validation_rms == pytest.approx(
        predictions(MACHINE, [run], result.rows).errors["joint1.torque"].validation_rms  # type: ignore[union-attr]
    )
    assert found.log_score is not None
    assert found.log_score.nominal < found.log_score.answer


def test_answer_worse_than_the_standard_model_is_replaced_and_unproven(run: Recording) -> None:
    name = Finding("stribeck_friction", "joint1", 0.99, {})
    wrong = ARM.with_effects(friction(9.0), friction(9.0, "joint2"))
    found = judged(compared(diagnosed(wrong, rows(run), name), ARM, [run], 1), ARM)
    diagnosis = found.diagnosis
    assert diagnosis.comparison.written == "standard"
    assert diagnosis.verdict == "unexplained"
    assert "worse than the standard model" in diagnosis.summary
    written = predictions(robot_from_toml(found.augmented_robot_toml), [run], found.rows)
    assert written is not None
    for channel, one in diagnosis.comparison.channels.items():
        assert one.answer == written.errors[channel]  # whatever is written is what is stated
        assert one.standard is not None
        assert one.answer.validation_rms <= 1.02 * one.standard.validation_rms


def test_a_joint_that_the_standard_model_predicts_better_gets_its_friction(run: Recording) -> None:
    noise = dict.fromkeys(CHANNELS, 0.0)
    own = rows(run)

    def made(robot: Robot) -> Predictions:
        found = predictions(robot, [run], own)
        assert found is not None
        return found

    standard = made(fit_standard(ARM, [run], held_out=[own[0].windows]).robot)
    small = 1.2 * standard.errors["joint2.torque"].validation_rms
    spoiled = made(MACHINE.with_effects(friction(small, "joint2")))
    # The second joint is worse by friction that is not there; the first decides the whole.
    first = replace(standard, errors={**standard.errors, "joint1.torque": Errors(1.0, 1.0)})
    choice = chosen(spoiled, made(ARM), first, noise, made)
    assert choice.written == "standard_friction"
    assert choice.worse == ("joint2.torque",)
    assert {use.effect for use in choice.predictions.robot.effects if use.at == "joint2"} == {
        "viscous_friction",
        "coulomb_friction",
        "torque_offset",
    }
    assert friction(3.0) in choice.predictions.robot.effects


def test_held_out_stretches_are_not_fitted(run: Recording) -> None:
    """Arbitrary data in a held-out stretch change no estimate."""
    inside = (run.time > 3.5) & (run.time < 4.0)
    spoiled = run.with_channels({c: np.where(inside, run[c] + 50.0, run[c]) for c in CHANNELS})
    plain = fit_standard(ARM, [run], cutoff=8.0, held_out=[[(2.5, 5.0)]]).estimate.values
    blind = fit_standard(ARM, [spoiled], cutoff=8.0, held_out=[[(2.5, 5.0)]]).estimate.values
    seen = fit_standard(ARM, [spoiled], cutoff=8.0).estimate.values
    assert np.abs(blind - plain).max() < 0.1 * np.abs(seen - plain).max()


def test_missing_standard_model_is_explained(run: Recording) -> None:
    found = compared(_empty(), ARM, [run], 1).diagnosis
    assert "do not contain enough data" in found.comparison.words


def _empty() -> Result:
    diagnosis = Diagnosis("arm", ("simulated",), (), "not_enough_data", "", (), (), Fit({}, 0.0))
    return Result(diagnosis, (), (), robot_to_toml(ARM))


def test_singular_regression_gives_one_sentence(run: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(*_: object) -> None:
        raise np.linalg.LinAlgError

    monkeypatch.setattr("missing_physics.standard.model.estimate", singular)
    with pytest.raises(InputError, match="cannot be identified"):
        fit_standard(ARM, [run])
    found = compared(diagnosed(MACHINE, rows(run)), ARM, [run], 1).diagnosis
    assert "No standard model" in found.comparison.words
    assert found.comparison.channels["joint1.torque"].standard is None


def test_joint_without_usable_samples_is_named(run: Recording) -> None:
    [own] = rows(run)
    still = replace(own, counted=own.counted & np.array([True, False]))
    assert not_judged(ARM, (still,)) == ("joint2",)
    later = replace(own, counted=own.counted & (np.array([True, False]) | own.held_out[:, None]))
    assert later.counted[:, 1].any()
    assert not_judged(ARM, (later,)) == ("joint2",)
    assert not_judged(ARM, rows(run, CHANNELS[:1])) == ("joint2",)
    assert not_judged(ARM, (own,)) == ()


def test_the_standard_model_fits_the_compared_rows_at_least_as_well_as_the_file(run: Recording) -> None:
    """Also where the recording is compared far above the motion's band."""
    wide = [replace(own, band=Band(60.0, 100.0)) for own in rows(run)]
    found = compared(diagnosed(MACHINE, tuple(wide)), ARM, [run], 1).diagnosis.comparison
    for one in found.channels.values():
        assert one.standard is not None
        assert one.standard.train_rms < 1.02 * one.nominal.train_rms
