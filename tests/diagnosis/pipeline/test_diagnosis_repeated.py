"""Results are reproducible, independent of names and time origin, and documented."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from end_to_end_cases import ARM, CASES, QUICK

from missing_physics.diagnosis import Diagnosis, Result, diagnose
from reference_model.simulation import simulate
from robot_model import Recording

pytestmark = pytest.mark.proof


@pytest.fixture(scope="module")
def coulomb() -> Recording:
    return simulate(ARM.with_effects(CASES["coulomb"].hidden), seed=1)


@pytest.fixture(scope="module")
def answer(coulomb: Recording) -> Result:
    return diagnose(ARM, [coulomb])


def test_the_same_input_and_seed_give_the_same_file(coulomb: Recording, answer: Result) -> None:
    again = diagnose(ARM, [coulomb])
    assert again.diagnosis.to_json() == answer.diagnosis.to_json()
    assert again.augmented_robot_toml == answer.augmented_robot_toml
    assert again.ladder == answer.ladder


def without_names(found: Diagnosis) -> dict[str, Any]:
    plain = {k: v for k, v in found.to_dict().items() if k not in ("recordings", "validation")}
    timing = [{k: v for k, v in one.items() if k != "recording"} for one in plain["timing"]]
    return {**plain, "timing": timing}


def test_result_does_not_depend_on_names_order_or_further_channels(
    coulomb: Recording, answer: Result
) -> None:
    """The diagnosis sees the robot and the arrays of motion and torque, whatever else stands there."""
    exact = simulate(ARM.with_effects(CASES["coulomb"].hidden), sensors=False)
    leaked = {"joint1.friction_torque": exact["joint1.friction_torque"], **coulomb.channels}
    blind = replace(
        coulomb, channels=dict(reversed(leaked.items())), source="viscous_friction, nothing missing"
    )
    assert without_names(diagnose(ARM, [blind]).diagnosis) == without_names(answer.diagnosis)


def test_result_does_not_depend_on_the_time_origin(coulomb: Recording, answer: Result) -> None:
    later = replace(coulomb, time=coulomb.time + 64.0)
    found, before = diagnose(ARM, [later]).diagnosis, answer.diagnosis
    assert found.verdict == before.verdict
    assert [(f.effect, f.location) for f in found.findings] == [
        (f.effect, f.location) for f in before.findings
    ]
    for one, other in zip(found.findings, before.findings):
        for name, estimate in one.parameters.items():
            # sample times after 64 s carry 1e-14 of rounding, of steps of 4 ms
            assert estimate.value == pytest.approx(other.parameters[name].value, rel=1e-6)
            assert estimate.ci95 == pytest.approx(other.parameters[name].ci95, rel=1e-5)


def test_series_steps_and_notes_document_the_diagnosis(answer: Result) -> None:
    found = answer.diagnosis
    wanted = {f"joint{k}.torque" for k in (1, 2)}
    assert {s.channel for s in answer.series} == set(found.fit.channels) == wanted
    for series in answer.series:
        sizes = {a.size for a in (series.time, series.measured, series.nominal, series.augmented)}
        assert sizes == {series.held_out.size}
        assert 0.15 < series.held_out.mean() < 0.35
        before, after = (np.std(series.measured - y) for y in (series.nominal, series.augmented))
        assert after < 1.05 * before
    assert [(f.effect, f.location) for f in found.findings] == [("coulomb_friction", "joint1")]
    assert any("A quarter of each recording" in note for note in found.notes)


def test_validation_recording_is_scored_but_not_fitted(coulomb: Recording) -> None:
    other = simulate(ARM.with_effects(CASES["coulomb"].hidden), seed=2)
    diagnosis: list[str] = []
    result = diagnose(ARM, [coulomb], [other], options=QUICK, progress=diagnosis.append)
    found = result.diagnosis
    assert found.validation == (other.source,)
    assert {s.role for s in result.series} == {"train", "validation"}
    assert all(s.held_out.all() == (s.role == "validation") for s in result.series)
    assert found.fit.validation_improvement > 0.8
    assert not any("A quarter of each recording" in note for note in found.notes)
    assert "weighing hypotheses" in diagnosis
