"""The EMPS positioning axis: a real recording whose friction has been published, held against our answer.

Janot, Gautier, Brunot, "Data set and reference models of EMPS", 2019:
M q" + Fv q' + Fc sign(q') + OF = force. Fitted to the estimation file alone, scored on the pulses.
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

import pytest

from missing_physics.diagnosis import Diagnosis, Options, diagnose
from missing_physics.recordings import load_mapping, load_recording
from robot_model import load_robot

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "examples" / "emps"
#: As published [N s/m, N].
VISCOUS, COULOMB = 203.5034, 20.3935


@pytest.fixture(scope="module")
def real() -> Path:
    """The folder of public real recordings."""
    for folder in (os.environ.get("MISSING_PHYSICS_DATA"), ROOT.parent / "shared" / "recordings"):
        if folder and (Path(folder) / "emps" / "DATA_EMPS.mat").is_file():
            return Path(folder)
    pytest.skip("the real recordings are not here; fetch them and set MISSING_PHYSICS_DATA")


@lru_cache
def diagnosed(folder: Path, nominal: str) -> Diagnosis:
    mapping = load_mapping(EXAMPLE / "map.toml")
    fitted, scored = (
        load_recording(folder / "emps" / name, mapping=mapping)
        for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")
    )
    robot = load_robot(EXAMPLE / f"{nominal}.toml")
    return diagnose(robot, [fitted], [scored], options=Options(experiments=False)).diagnosis


@pytest.mark.proof
def test_friction_is_named_from_the_mass_alone_and_close_to_what_was_published(real: Path) -> None:
    found = {f.effect: f for f in diagnosed(real, "mass_only").findings}
    viscous = found["viscous_friction"].parameters["coefficient"]
    coulomb = found["coulomb_friction"].parameters["torque"]
    # The published model has no friction that depends on the direction, which is named here beside these.
    assert viscous.value == pytest.approx(VISCOUS, rel=0.1)
    assert coulomb.value == pytest.approx(COULOMB, rel=0.1)
    assert all(f.location.split(".")[0] == "joint1" for f in found.values())
    assert all(e.ci95[0] < e.value < e.ci95[1] for f in found.values() for e in f.parameters.values())


@pytest.mark.proof
@pytest.mark.parametrize("nominal", ["mass_only", "published"])
def test_friction_depends_on_the_direction_and_predicts_the_pulses_better(real: Path, nominal: str) -> None:
    result = diagnosed(real, nominal)
    assert "asymmetric_friction" in {f.effect for f in result.findings}
    errors = result.comparison.channels["joint1.torque"]
    assert errors.standard is not None
    assert errors.answer.validation_rms < 0.8 * errors.standard.validation_rms
    assert errors.answer.validation_rms < 0.8 * errors.nominal.validation_rms
