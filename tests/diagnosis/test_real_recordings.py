"""The EMPS positioning axis: a real recording whose friction has been published, held against our answer.

Janot, Gautier, Brunot, "Data set and reference models of EMPS", 2019:
M q" + Fv q' + Fc sign(q') + OF = force.
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

import pytest

from missing_physics.diagnosis import Diagnosis, Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.recordings import load_mapping, load_recording
from missing_physics.results.result import Stage
from robot_model import load_robot

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "emps"
#: As published; the offset stands on the side of the resistances there and acts on the carriage here.
PUBLISHED = {
    ("viscous_friction", "coefficient"): 203.5034,
    ("coulomb_friction", "torque"): 20.3935,
    ("torque_offset", "torque"): 3.1648,
}
MASS = 95.1089
#: Plain least squares with the published structure leaves 4.03 and 5.95 % of the force.
ESTIMATION, PULSES = 0.041, 0.060


@pytest.fixture(scope="module")
def real() -> Path:
    """The folder of public real recordings."""
    for folder in (os.environ.get("MISSING_PHYSICS_DATA"), ROOT.parent / "shared" / "recordings"):
        if folder and (Path(folder) / "emps" / "DATA_EMPS.mat").is_file():
            return Path(folder)
    pytest.skip("the real recordings are not here; fetch them and set MISSING_PHYSICS_DATA")


@lru_cache
def diagnosed(folder: Path, nominal: str) -> Diagnosis:
    """Fitted to the estimation file alone, scored on the pulses with nothing refitted."""
    mapping = load_mapping(EXAMPLE / "map.toml")
    fitted, scored = (
        load_recording(folder / "emps" / name, mapping=mapping)
        for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")
    )
    robot = load_robot(EXAMPLE / f"{nominal}.toml")
    return diagnose(robot, [fitted], [scored], options=Options(experiments=False)).diagnosis


def assert_fits(found: Diagnosis) -> None:
    """As good as the published structure or better, and by the help of everything that was named."""
    after = found.fit.channels["joint1.torque"].relative_error_after
    assert after is not None
    assert after.train_rms <= ESTIMATION
    assert after.validation_rms <= PULSES
    assert all(finding.location.split(".")[0] == "joint1" for finding in found.findings)
    assert all(finding.validation_improvement > 0 for finding in found.findings)
    assert found.fit.validation_improvement > 0


def friction_stage(found: Diagnosis) -> Stage:
    """The first explanation with viscous and Coulomb friction and the offset."""
    names = {f"{effect}@joint1" for effect, _ in PUBLISHED}
    return next(stage for stage in found.stages if names <= set(stage.parameters))


@pytest.mark.proof
def test_friction_is_named_from_the_mass_alone(real: Path) -> None:
    found = diagnosed(real, "mass_only")
    assert_fits(found)
    first = [stage.effects for stage in found.stages[:3]]
    assert set(first[1]) == {"coulomb_friction@joint1", "viscous_friction@joint1"}
    assert set(first[2]) == {*first[1], "torque_offset@joint1"}
    named = [finding.effect for finding in found.findings]
    assert set(named[:2]) == {"coulomb_friction", "viscous_friction"}
    assert found.fit.validation_improvement > 0.9


def test_the_published_values_are_found_and_inside_the_intervals(real: Path) -> None:
    stage = friction_stage(diagnosed(real, "mass_only"))
    for (effect, name), value in PUBLISHED.items():
        estimate = stage.parameters[f"{effect}@joint1"][name]
        # asked for: 1 % of M, Fv, Fc and 3 % of OF
        assert estimate.value == pytest.approx(value, rel=0.03 if effect == "torque_offset" else 0.01)
        assert estimate.ci95[0] < value < estimate.ci95[1]
    [mass] = [p for p in stage.nominal_parameters if p.name == "carriage.mass"]
    assert mass.estimate == pytest.approx(MASS, rel=0.01)
    assert mass.ci95[0] < MASS < mass.ci95[1]


def test_the_final_friction_still_contains_the_published_one(real: Path) -> None:
    """Whatever else was named, dry and viscous friction have not moved away."""
    findings = {finding.effect: finding for finding in diagnosed(real, "mass_only").findings}
    for effect, name in (("coulomb_friction", "torque"), ("viscous_friction", "coefficient")):
        low, high = findings[effect].parameters[name].ci95
        assert low < PUBLISHED[effect, name] < high


@pytest.mark.proof
def test_what_is_named_beside_the_published_model_lowers_the_held_out_error(real: Path) -> None:
    found = diagnosed(real, "published")
    assert found.findings
    assert all(finding.validation_improvement > 0 for finding in found.findings)
    assert not {finding.effect for finding in found.findings} & {effect for effect, _ in PUBLISHED}
    after = found.fit.channels["joint1.torque"].relative_error_after
    assert after is not None
    assert after.validation_rms <= PULSES
    # Beside the published friction there is more than any law of the catalogue says.
    assert found.verdict == "explained"
    [more] = found.unnamed
    assert "joint1.velocity" in more.depends_on


@pytest.mark.proof
def test_friction_is_found_behind_a_tuned_model(real: Path) -> None:
    found = diagnosed(real, "tuned_away")
    assert_fits(found)
    assert found.findings[0].effect == "coulomb_friction"
    assert found.stages[0].effects == ("coulomb_friction@joint1",)
    stage = friction_stage(found)
    for (effect, name), value in PUBLISHED.items():
        low, high = stage.parameters[f"{effect}@joint1"][name].ci95
        assert low < value < high
