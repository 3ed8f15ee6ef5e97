"""Gyros of a free-flyer: base effects are named with correct intervals, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest
from floating_cases import GYRO, flyer
from floating_gyros import diagnosed, recorded, small

from missing_physics.diagnosis.base.data import BaseData
from missing_physics.diagnosis.base.file import with_base
from missing_physics.diagnosis.base.information import of_bodies
from missing_physics.diagnosis.base.stage import BaseResult
from missing_physics.hypotheses import Term
from missing_physics.inference.torques.data import TorqueData
from missing_physics.motion.base.rates import Rates
from missing_physics.motion.recorded import make_dynamics
from missing_physics.results.result import Diagnosis, Fit, Result
from missing_physics.standard import fit_standard
from reference_model.dynamics.inertial import nominal_inertial
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, robot_from_toml, robot_to_toml

WHEEL = {"momentum_x": 3.0, "momentum_y": -2.0, "momentum_z": 5.0, "torque_x": 0.1, "torque_z": -0.05}
LIQUID = {"mass": 24.0, "frequency": 0.35, "damping_ratio": 0.02, "x": 0.2, "z": -0.3}


def names(found: BaseResult) -> set[tuple[str, str]]:
    """Effects and places that are stated."""
    return {(finding.effect, finding.location) for finding in found.findings}


def test_with_a_correct_robot_file_gyros_give_no_finding() -> None:
    robot = small()
    found = diagnosed(robot, [recorded(robot)])
    assert not found.findings
    assert not found.mismatch
    assert set(found.fit) == set(GYRO)


@pytest.mark.proof
def test_wrong_base_inertia_is_not_named_as_sloshing() -> None:
    robot = small()
    base = robot.base.model_copy(update={"inertia": tuple(1.05 * i for i in robot.base.inertia)})
    found = diagnosed(robot, [recorded(small(base=base))])
    assert not found.findings
    assert any("masses, centres or inertias" in sentence for sentence in found.could_not_tell)


def test_reaction_wheels_are_named() -> None:
    robot = small()
    found = diagnosed(robot, [recorded(robot, EffectUse(effect="reaction_wheel", at="base", **WHEEL))])
    assert names(found) == {("reaction_wheel", "base")}
    for name, truth in WHEEL.items():
        low, high = found.findings[0].parameters[name].ci95
        assert low <= truth <= high
    assert "reaction_wheel" in found.searched
    assert all(c.after.validation_rms < 0.1 * c.before.validation_rms for c in found.fit.values())
    diagnosis = Diagnosis("flyer", ("one",), (), "consistent", "", (), (), Fit({}, 0.0))
    whole = with_base(Result(diagnosis, (), (), robot_to_toml(robot)), found, robot)
    assert whole.diagnosis.verdict == "explained"
    uses = {(use.effect, use.at): use for use in robot_from_toml(whole.augmented_robot_toml).effects}
    assert uses["reaction_wheel", "base"].parameters["torque_x"] == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize(("effect", "values"), [("reaction_wheel", WHEEL), ("slosh", LIQUID)])
def test_columns_of_base_effects_equal_a_simulation(effect: str, values: dict[str, float]) -> None:
    """The wheels' to the error of the model, the liquid's to a twentieth: it answers to first order."""
    robot = small()
    made = recorded(robot, EffectUse.model_validate({"effect": effect, "at": "base", **values}))
    data = BaseData.of([Rates(*make_dynamics(robot, [made]), made, GYRO)], 1)
    left = data.target(0) - data.nominal(0)
    term = Term.of(get_effect(effect), "base", values)
    after = left - data.terms.contributed([term], 0)
    worst = np.sqrt(np.mean(after**2, axis=0)) / np.linalg.norm(np.sqrt(np.mean(left**2, axis=0)))
    assert worst.max() < (0.01 if effect == "reaction_wheel" else 0.05)


@pytest.mark.proof
def test_sloshing_liquid_is_named() -> None:
    robot = small()
    longer = recorded(
        flyer(12.0).model_copy(update={"effects": ()}), EffectUse(effect="slosh", at="base", **LIQUID)
    )
    found = diagnosed(robot, [longer], cutoff=None)
    assert names(found) == {("slosh", "base")}
    stated = found.findings[0].parameters
    assert stated["frequency"].value == pytest.approx(0.35, rel=0.02)
    assert stated["mass"].value == pytest.approx(24.0, rel=0.15)


@pytest.mark.proof
def test_gyro_scale_error_is_named_if_the_inertias_are_known() -> None:
    robot = small(known=("base", "link1", "link2"))
    made = recorded(robot)
    wrong = made.with_channels({GYRO[2]: 1.02 * made[GYRO[2]]})
    found = diagnosed(robot, [wrong])
    assert names(found) == {("sensor_gain", GYRO[2])}
    assert found.findings[0].parameters["gain_error"].value == pytest.approx(0.02, abs=2e-3)


def test_gyros_inform_the_inertial_parameters_of_the_right_bodies() -> None:
    """The gradient of their likelihood at the truth is as large as its own standard deviation."""
    robot = small()
    found = of_bodies(diagnosed(robot, [recorded(robot)]))
    assert found is not None
    truth = nominal_inertial(robot)[: len(found.names)]
    size = np.sqrt(np.maximum(np.diag(found.matrix), 1e-300))
    scaled = found.matrix / np.outer(size, size)
    values, vectors = np.linalg.eigh(scaled)
    sure = values > 1e-6 * values[-1]
    gradient = vectors[:, sure].T @ ((found.vector - found.matrix @ truth) / size)
    assert np.mean(gradient**2 / values[sure]) < 4.0


def test_standard_model_recovers_a_much_heavier_base() -> None:
    """How it moves follows from the estimated bodies, not from those of the file."""
    robot = small()
    base = robot.base.model_copy(
        update={"mass": 1.3 * robot.base.mass, "inertia": tuple(1.35 * i for i in robot.base.inertia)}
    )
    standard = fit_standard(robot, [made := recorded(small(base=base))])
    data = TorqueData.of(standard, [made])
    assert np.all(data.sigma < 1.5 * np.hypot(data.noise, data.error))
