"""Effects that runs alone find, where torques along the motion tell of nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest
from end_to_end_cases import AXIS, FRICTION, QUICK, otherwise, within
from rescue_cases import SPRING, deafened, term_of

from missing_physics.diagnosis import Diagnosis, diagnose, run_search
from missing_physics.diagnosis.explanation import Explanation, explain
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot

LACKS = AXIS.model_copy(update={"effects": ()})


def told(*hidden: EffectUse, held_out: bool = True, file: Robot = LACKS) -> Diagnosis:
    real = LACKS.with_effects(*hidden)
    recordings = [simulate(r, seed=k) for k, r in enumerate((real, otherwise(real)))]
    validation = recordings[1:] if held_out else []
    return diagnose(file, recordings[:1], validation, options=QUICK).diagnosis


@pytest.fixture(autouse=True)
def _deafened(monkeypatch: pytest.MonkeyPatch) -> None:
    deafened(monkeypatch)


def test_an_effect_is_found_with_its_number() -> None:
    found = told(SPRING)
    assert found.verdict == "explained"
    [finding] = found.findings
    assert (finding.effect, finding.location) == ("cable_spring", "joint1")
    # runs tell 600 N/m to a thousandth and better
    assert finding.parameters["stiffness"].value == pytest.approx(600.0, rel=1e-3)
    low, high = finding.parameters["stiffness"].ci95
    assert low < 600.0 < high
    assert {item.location for item in found.mismatch} == {"joint1"}


@pytest.mark.proof
def test_numbers_that_hide_it_in_the_fitted_recording_are_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Masses moved by a regression may do there what is missing; here a spring that the file lacks does."""

    def hiding(replay: object, start: Explanation, build: object) -> Explanation:
        spring = replace(term_of(SPRING), nominal=True, frozen=True)
        return explain(start.problem, start.view, [*start.terms, spring], nuisance=False)

    monkeypatch.setattr(run_search, "plainer", hiding)
    [finding] = told(SPRING).findings
    assert (finding.effect, finding.location) == ("cable_spring", "joint1")


@pytest.mark.proof
def test_numbers_of_the_file_that_were_tuned_without_it_come_back_with_it() -> None:
    """A carriage half a kilogram too light, and friction that the robot has not, hide part of a spring."""
    [carriage] = LACKS.links
    tuned = LACKS.model_copy(
        update={"links": (carriage.model_copy(update={"mass": carriage.mass - 0.5}),)}
    ).with_effects(EffectUse(effect="viscous_friction", at="joint1", coefficient=3.0))
    found = told(SPRING, file=tuned)
    [finding] = found.findings
    assert (finding.effect, finding.location) == ("cable_spring", "joint1")
    assert within(finding.parameters["stiffness"], 600.0)
    assert finding.parameters["stiffness"].value == pytest.approx(600.0, rel=5e-3)  # within its interval
    own = {change.name: change for change in found.nominal_parameters}
    assert own["viscous_friction@joint1.coefficient"].estimate == pytest.approx(0.0, abs=0.1)
    moved = sum(c.estimate - c.nominal for name, c in own.items() if name.endswith(("mass", "inertia")))
    assert moved == pytest.approx(0.5, abs=0.02)


@pytest.mark.proof
def test_where_two_are_missing_both_are_found() -> None:
    """One alone leaves more than noise, whatever its numbers."""
    found = told(SPRING, FRICTION)
    assert found.verdict == "explained"
    named = {f.effect: f for f in found.findings}
    assert set(named) == {"cable_spring", "coulomb_friction"}
    # runs tell 600 N/m and 30 N to a thousandth and better
    assert named["cable_spring"].parameters["stiffness"].value == pytest.approx(600.0, rel=1e-3)
    assert named["coulomb_friction"].parameters["torque"].value == pytest.approx(30.0, rel=1e-3)


def test_nothing_is_found_where_no_recording_was_held_out() -> None:
    assert not told(SPRING, held_out=False).findings


def test_nothing_is_found_where_nothing_is_missing() -> None:
    found = told()
    assert found.verdict == "consistent"
    assert not found.findings


@pytest.mark.proof
def test_two_that_each_do_a_part_are_found_together() -> None:
    """An encoder's zero, which no torque tells where nothing pulls, and a torque sensor's gain."""
    zero = EffectUse(effect="sensor_offset", at="joint1.position", offset=2e-3)
    gain = EffectUse(effect="sensor_gain", at="joint1.torque", gain_error=-0.06)
    found = told(zero, gain)
    named = {(f.effect, f.location): f for f in found.findings}
    assert set(named) == {("sensor_offset", "joint1.position"), ("sensor_gain", "joint1.torque")}
    # both stand out of the noise by far more than a hundredth
    assert named["sensor_offset", "joint1.position"].parameters["offset"].value == pytest.approx(
        2e-3, rel=0.01
    )
    assert named["sensor_gain", "joint1.torque"].parameters["gain_error"].value == pytest.approx(
        -0.06, rel=0.01
    )
