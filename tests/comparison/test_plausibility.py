"""What numbers of machines can be: one table, and nothing is stated beyond it."""

from __future__ import annotations

import numpy as np
import pytest

from missing_physics.diagnosis.comparison.credible import credible, in_the_file
from missing_physics.evaluation import Band
from missing_physics.plausibility import NOT_CREDIBLE, TABLE, implausible, is_credible_number
from missing_physics.results.result import Diagnosis, Estimate, Finding, Fit, ParameterChange, Result, Rung
from missing_physics.results.samples import Rows
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, load_robot, robot_from_toml, robot_to_toml

ARM = load_robot("two_link_arm")
SPACE = load_robot("six_joint_space_arm")
WEIGHTLESS = ARM.model_copy(update={"gravity": (0.0, 0.0, 0.0)})


def test_every_row_is_of_the_catalogue_with_its_unit_and_narrower_than_it() -> None:
    for row in TABLE:
        parameter = get_effect(row.effect).parameter(row.parameter)
        assert parameter.unit == row.unit
        assert parameter.lower <= row.low < row.high <= parameter.upper
        assert (row.low, row.high) != (parameter.lower, parameter.upper)
        assert row.reason
        assert row.source


@pytest.mark.parametrize(
    ("effect", "place", "values", "credible"),
    [
        ("sensor_gain", "joint1.position", {"gain_error": 0.29}, False),
        ("sensor_gain", "joint1.position", {"gain_error": 5e-5}, True),
        ("sensor_gain", "joint1.torque", {"gain_error": 0.06}, True),
        ("torque_gain", "joint1", {"gain_error": -0.4}, False),
        ("torque_gain", "joint1", {"gain_error": -0.08}, True),
        ("sensor_delay", "joint1.position", {"delay": 0.008}, False),
        ("sensor_delay", "joint1.motor_position", {"delay": 0.003}, True),
        ("sensor_delay", "joint1.torque", {"delay": 0.03}, True),
        ("clock_drift", "joint1.torque", {"rate": -2e-3}, False),
        ("clock_drift", "joint1.torque", {"rate": 5e-4}, True),
        ("gravity", "base", {"x": 0.6, "y": 0.0, "z": 0.0}, False),
        ("gravity", "base", {"x": 0.0, "y": 0.0, "z": 5.0}, False),
        ("gravity", "base", {"x": 0.3, "y": 0.0, "z": 0.0}, True),
        ("coulomb_friction", "joint1", {"torque": 1e3}, True),
    ],
)
def test_what_can_be(effect: str, place: str, values: dict[str, float], credible: bool) -> None:
    why = implausible(effect, place, values, ARM)
    assert (why == "") is credible
    assert credible or why.startswith(NOT_CREDIBLE)


@pytest.mark.parametrize("robot", [SPACE, WEIGHTLESS])
def test_gravity_may_be_any_where_a_robot_floats_or_its_file_has_none(robot) -> None:  # type: ignore[no-untyped-def]
    assert implausible("gravity", "base", {"x": 0.0, "y": 0.0, "z": -9.81}, robot) == ""


def test_no_actuator_is_limited_far_below_the_torque_that_was_needed() -> None:
    assert implausible("torque_saturation", "joint1", {"limit": 0.0055}, ARM, needed=1.2)
    assert not implausible("torque_saturation", "joint1", {"limit": 1.1}, ARM, needed=1.2)


def test_what_cannot_be_is_neither_named_nor_written_and_said_to_be_dismissed() -> None:
    gain = EffectUse(effect="sensor_gain", at="joint1.position", **{"gain_error": 0.29})
    dry = EffectUse(effect="coulomb_friction", at="joint1", **{"torque": 3.0})
    names = [
        Finding("sensor_gain", "joint1.position", 0.9, {"gain_error": Estimate(0.29, (0.28, 0.3), "-")}),
        Finding("coulomb_friction", "joint1", 0.9, {"torque": Estimate(3.0, (2.9, 3.1), "N m")}),
    ]
    bad = "it is not credible: a limit of 0.0055, while the recorded motion needed a torque of 1.2"
    rung = Rung("torque_saturation", "joint2", (), 1.0, 1.0, 50.0, False, bad)
    told = Diagnosis("arm", (), (), "explained", "", (), tuple(names), Fit({}, 0.0))
    written = robot_to_toml(ARM.with_effects(gain, dry))
    found = credible(Result(told, (), (rung,), written), ARM)
    assert [finding.effect for finding in found.diagnosis.findings] == ["coulomb_friction"]
    uses = robot_from_toml(found.augmented_robot_toml).effects
    assert dry in uses
    assert gain not in uses
    sentences = " ".join(found.diagnosis.could_not_tell)
    assert "Not named: Sensor gain error at joint1.position fits, but it is not credible" in sentences
    assert "at joint2 fits, but it is not credible: a limit of 0.0055" in sentences


def test_numbers_are_stated_as_the_written_file_has_them() -> None:
    link = ARM.links[-1]
    told = [
        ParameterChange(f"{link.name}.mass", "kg", link.mass, link.mass, (-1.0, 50.0)),
        ParameterChange(f"{link.name}.inertia.zz", "kg m^2", 0.1, -0.007, (-0.0077, -0.0071)),
        ParameterChange("viscous_friction@joint1.coefficient", "N m s/rad", 1.0, 2.0, (1.9, 2.1)),
    ]
    mass, friction = in_the_file(told, ARM, standard=False)
    assert mass.estimate == link.mass
    assert mass.ci95 == (0.0, 50.0)
    assert friction == told[2]
    assert in_the_file(told, ARM, standard=True) == ()


def test_nothing_is_named_at_a_joint_that_nothing_fitted_moves() -> None:
    """What lies between two encoders is judged without its torque."""
    names = [
        Finding("coulomb_friction", "joint1", 0.9, {"torque": Estimate(3.0, (2.9, 3.1), "N m")}),
        Finding("sensor_offset", "joint2.position", 0.9, {"offset": Estimate(-0.1, (-0.2, -0.1), "rad")}),
        Finding("backlash", "joint2", 0.9, {"half_width": Estimate(1e-3, (9e-4, 1.1e-3), "rad")}),
    ]
    uses = [EffectUse(effect="coulomb_friction", at="joint1", **{"torque": 3.0})]
    uses.append(EffectUse(effect="sensor_offset", at="joint2.position", **{"offset": -0.1}))
    moved = np.column_stack([np.ones(20, dtype=bool), np.arange(20) >= 15])
    channels = "joint1.torque", "joint2.torque"
    time, held_out = np.arange(20.0), np.arange(20) >= 15
    rows = Rows(channels, np.full(2, 0.1), time, held_out, moved, Band(8.0, 40.0))
    told = Diagnosis("arm", (), (), "explained", "", (), tuple(names), Fit({}, 0.0))
    found = credible(Result(told, (), (), robot_to_toml(ARM.with_effects(*uses)), rows=(rows,)), ARM)
    assert [finding.effect for finding in found.diagnosis.findings] == ["coulomb_friction", "backlash"]
    assert "sensor_offset" not in {use.effect for use in robot_from_toml(found.augmented_robot_toml).effects}
    assert "no fitted recording moves that joint" in " ".join(found.diagnosis.could_not_tell)


@pytest.mark.parametrize(
    ("name", "nominal", "estimate", "expected"),
    [
        ("link1.mass", 30.0, 46.0, True),
        ("link1.mass", 30.0, 7.5, False),
        ("link1.inertia.zz", 247.5, 2e-3, False),
        ("link2.tip_mass", 50.0, 75.0, True),
        ("link2.stiffness", 1.0, 0.2, False),
        ("joint1.reflected_inertia", 1.3, 0.001, False),
        ("joint1.reflected_inertia", 0.0, 1.3, True),
        ("joint1.coulomb", 1.0, 9.0, True),  # friction may be anything
    ],
)
def test_bodies_may_be_off_by_what_drawings_leave_out(
    name: str, nominal: float, estimate: float, expected: bool
) -> None:
    robot = load_robot("flexible_space_robot")
    assert is_credible_number(name, estimate, nominal, robot) == expected
