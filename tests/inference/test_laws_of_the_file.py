"""Friction laws in the robot file: known, re-estimated if wrong, and never named as missing."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_arm import COULOMB, VISCOUS, Hidden, asymmetric, nothing, recorded, spring

from missing_physics.diagnosis import diagnose
from missing_physics.diagnosis.given import require_weighable
from missing_physics.hypotheses import Hypothesis
from missing_physics.inference import fitted
from missing_physics.inference.ledger import ODDS, prior
from missing_physics.inference.torques.data import TorqueData
from missing_physics.results.result import Result
from missing_physics.standard import fit_standard
from reference_model.effects.along import EffectAlong
from reference_model.effects.base import JointEffect, JointSignals
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, InputError, Recording, Robot, robot_from_toml

Array = np.ndarray
STATIC, SLOW = 0.9, 0.3
#: The temperature rises by 60 K, and friction falls by two thirds.
WARMING, RATE, ROOM = 60.0 / 24.0, 0.02, 293.15
BRISTLES = {"bristle_stiffness": 20.0, "bristle_damping": 0.4}


def excess(time: Array, position: Array, velocity: Array) -> Array:
    """What Stribeck friction has beyond Coulomb friction."""
    return (STATIC - COULOMB) * np.exp(-((velocity / SLOW) ** 2)) * np.sign(velocity)


def bristles(time: Array, position: Array, velocity: Array) -> Array:
    """What LuGre friction has beyond Coulomb friction."""
    effect = get_effect("lugre_friction")
    assert isinstance(effect, JointEffect)
    signals = np.zeros((time.size, len(JointSignals.CHANNELS)))
    signals[:, :3] = np.column_stack([time, position, velocity])
    force = EffectAlong(effect).torque(signals, {**law()["values"], **BRISTLES})
    return -force - COULOMB * np.sign(velocity)


def warm(time: Array, position: Array, velocity: Array) -> Array:
    """What friction loses as the joint becomes warm."""
    return (np.exp(-RATE * WARMING * time) - 1.0) * (VISCOUS * velocity + COULOMB * np.sign(velocity))


def both(*parts: Hidden) -> Hidden:
    return lambda time, position, velocity: np.sum([one(time, position, velocity) for one in parts], axis=0)


def law(static: float = STATIC) -> dict[str, dict[str, float]]:
    return {"values": {"coulomb_torque": COULOMB, "static_torque": static, "stribeck_velocity": SLOW}}


def viscous() -> EffectUse:
    return EffectUse(effect="viscous_friction", at="joint", coefficient=VISCOUS)


def with_stribeck(arm: Robot, static: float = STATIC) -> Robot:
    return arm.with_effects(
        viscous(), EffectUse(effect="stribeck_friction", at="joint", **law(static)["values"])
    )


def with_bristles(arm: Robot) -> Robot:
    return arm.with_effects(
        viscous(), EffectUse(effect="lugre_friction", at="joint", **law()["values"], **BRISTLES)
    )


def runs(hidden: Hidden) -> list[Recording]:
    found = []
    for run in (recorded(hidden, seed=1), recorded(hidden, seed=2)):
        found.append(run.with_channels({"joint.temperature": ROOM + WARMING * run.time}))
    return found


def diagnosed(robot: Robot, hidden: Hidden) -> Result:
    first, second = runs(hidden)
    return diagnose(robot, [first], [second])


def written(result: Result, effect: str) -> dict[str, float]:
    """Parameters of the only effect of that kind in the robot file that is written."""
    (use,) = [use for use in robot_from_toml(result.augmented_robot_toml).effects if use.effect == effect]
    return dict(use.parameters)


def test_correct_friction_law_of_the_robot_file_leaves_no_residual(arm: Robot) -> None:
    uneven = arm.with_effects(
        viscous(),
        EffectUse(effect="coulomb_friction", at="joint", torque=COULOMB),
        EffectUse(effect="asymmetric_friction", at="joint", coulomb_difference=0.0, viscous_difference=0.15),
    )
    cases = (with_stribeck(arm), excess), (with_bristles(arm), bristles), (uneven, asymmetric)
    for robot, hidden in cases:
        diagnosis = diagnosed(robot, hidden).diagnosis
        assert diagnosis.verdict == "consistent"
        assert diagnosis.findings == ()
        assert not diagnosis.nominal_parameters


def test_temperature_dependent_friction_is_relative_to_the_cold_joint_and_not_to_its_average(
    arm: Robot,
) -> None:
    robot = arm.with_effects(viscous(), EffectUse(effect="coulomb_friction", at="joint", torque=COULOMB))
    (found,) = diagnosed(robot, warm).diagnosis.findings
    assert found.effect == "temperature_dependent_friction"
    assert found.parameters["rate"].value == pytest.approx(RATE, rel=0.05)  # of the average it is half more


def test_temperature_dependent_friction_of_the_file_leaves_no_residual(arm: Robot) -> None:
    robot = arm.with_effects(
        viscous(),
        EffectUse(effect="coulomb_friction", at="joint", torque=COULOMB),
        EffectUse(effect="temperature_dependent_friction", at="joint", rate=RATE),
    )
    right = diagnosed(robot, warm).diagnosis
    assert right.verdict == "consistent"
    assert not right.nominal_parameters
    wrong = diagnosed(robot, nothing).diagnosis
    assert wrong.findings == ()
    (change,) = [c for c in wrong.nominal_parameters if "@" in c.name]
    assert change.name == "temperature_dependent_friction@joint.rate"
    assert change.estimate == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("kind", ["stribeck_friction", "lugre_friction"])
def test_with_a_friction_law_in_the_file_only_the_hidden_effect_is_named(arm: Robot, kind: str) -> None:
    robot = with_stribeck(arm) if kind == "stribeck_friction" else with_bristles(arm)
    result = diagnosed(robot, both(spring, excess if kind == "stribeck_friction" else bristles))
    diagnosis = result.diagnosis
    assert [f.effect for f in diagnosis.findings] == ["cable_spring"]
    assert diagnosis.findings[0].parameters["stiffness"].value == pytest.approx(1.5, rel=0.02)
    assert diagnosis.verdict == "explained"
    values = law()["values"] | (BRISTLES if kind == "lugre_friction" else {})
    assert {name: written(result, kind)[name] for name in values} == values


def test_wrong_static_torque_is_reported_as_a_changed_file_parameter(arm: Robot) -> None:
    result = diagnosed(with_stribeck(arm, 0.6 * STATIC), excess)
    diagnosis = result.diagnosis
    assert diagnosis.findings == ()
    (change,) = [c for c in diagnosis.nominal_parameters if "@" in c.name]
    assert change.name == "stribeck_friction@joint.static_torque"
    assert (change.nominal, change.unit) == (0.6 * STATIC, "N m")
    assert change.moved
    assert change.estimate == pytest.approx(STATIC, rel=0.02)  # rows of a tenth of a second smear slow motion
    assert written(result, "stribeck_friction")["static_torque"] == pytest.approx(change.estimate)
    assert written(result, "stribeck_friction")["coulomb_torque"] == COULOMB


def test_friction_law_that_replaces_that_of_the_file_is_named(arm: Robot) -> None:
    result = diagnosed(with_stribeck(arm), bristles)
    (finding,) = result.diagnosis.findings
    assert finding.effect == "lugre_friction"
    assert finding.note == "It replaces the robot file's stribeck_friction."
    assert "stribeck_friction" not in result.augmented_robot_toml


def test_friction_of_the_file_that_is_absent_is_reported_as_zero(arm: Robot) -> None:
    """The joint's dry friction in the recording is compensated, and the file has it."""

    def frictionless(time: Array, position: Array, velocity: Array) -> Array:
        return -COULOMB * np.sign(velocity)

    diagnosis = diagnosed(with_stribeck(arm), frictionless).diagnosis
    assert diagnosis.findings == ()
    changes = {c.name: c.estimate for c in diagnosis.nominal_parameters if "@" in c.name}
    assert changes["stribeck_friction@joint.static_torque"] == pytest.approx(0.0, abs=0.01)
    assert changes["stribeck_friction@joint.coulomb_torque"] == pytest.approx(0.0, abs=0.01)


def test_unknown_force_with_a_friction_law_in_the_file_is_reported_without_a_name(arm: Robot) -> None:
    def thinning(time: Array, position: Array, velocity: Array) -> Array:
        return 0.3 * np.arctan(velocity)

    diagnosis = diagnosed(with_stribeck(arm), both(excess, thinning)).diagnosis
    assert diagnosis.findings == ()
    (force,) = diagnosis.unnamed
    assert force.depends_on == ("joint.velocity",)
    assert not [change for change in diagnosis.nominal_parameters if "@" in change.name]


def test_friction_laws_of_the_file_are_not_penalised_and_changes_equally(arm: Robot) -> None:
    first, second = runs(excess)
    data = TorqueData.of(fit_standard(with_stribeck(arm), [first]), [first], [second])
    (given,) = data.given
    nominal = Hypothesis().taking_from_file(
        "joint.viscous", "joint.offset", "joint.reflected_inertia", "bodies"
    )
    nominal = given.added_to(nominal)
    changed = nominal.without(given.term)
    freed = Hypothesis((given.term.freeing("static_torque"),), nominal.held, nominal.from_file)
    fits = [fitted(data, hypothesis) for hypothesis in (nominal, freed, changed)]
    late = [
        0.5 * float((fit.parameter("timing") / data.layout.width[data.layout.names.index("timing")]) ** 2)
        for fit in fits
    ]
    costs = [-prior(data, fit, np.ones(fit.sigma.size)) - own for fit, own in zip(fits, late)]
    assert costs == pytest.approx([0.0, ODDS, 2.0 * ODDS], abs=1e-9)  # no law, and a free Coulomb friction


def test_two_friction_laws_of_one_kind_at_one_joint_are_rejected(arm: Robot) -> None:
    waves = [
        EffectUse(effect="position_dependent_friction", at="joint", cosine=0.1, sine=0.0, order=order)
        for order in (3.0, 5.0)
    ]
    require_weighable(arm.with_effects(waves[0]), [recorded(nothing, seed=1)])
    with pytest.raises(InputError, match="has position dependent friction twice at 'joint'; leave one"):
        require_weighable(arm.with_effects(*waves), [recorded(nothing, seed=1)])
