"""Plausible ranges of machine parameters, which no stated parameter exceeds."""

from __future__ import annotations

import pytest

from missing_physics.diagnosis.comparison.credible import in_the_file
from missing_physics.plausibility import NOT_CREDIBLE, TABLE, credible_range, implausible, is_credible_number
from missing_physics.results.result import ParameterChange
from reference_model.effects.catalogue import get_effect
from robot_model import load_robot

ARM = load_robot("two_link_arm")
SPACE = load_robot("six_joint_space_arm")
WEIGHTLESS = ARM.model_copy(update={"gravity": (0.0, 0.0, 0.0)})


def test_plausible_ranges_are_within_the_catalogue_and_have_its_units() -> None:
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
        ("contact", "link2", {"stiffness": 50.0}, False),
        ("contact", "link2", {"stiffness": 1e4}, True),
        ("clock_drift", "joint1.torque", {"rate": -2e-3}, False),
        ("clock_drift", "joint1.torque", {"rate": 5e-4}, True),
        ("gravity", "base", {"x": 1.7, "y": 0.0, "z": 0.15}, True),  # ten degrees askew
        ("gravity", "base", {"x": 9.81, "y": 0.0, "z": 9.81}, True),  # on a wall
        ("gravity", "base", {"x": 0.0, "y": 0.0, "z": 5.0}, False),
        ("gravity", "base", {"x": 0.3, "y": 0.0, "z": 0.0}, True),
        ("coulomb_friction", "joint1", {"torque": 1e3}, True),
    ],
)
def test_plausible_and_implausible_values_are_distinguished(
    effect: str, place: str, values: dict[str, float], credible: bool
) -> None:
    why = implausible(effect, place, values, ARM)
    assert (why == "") is credible
    assert credible or why.startswith(NOT_CREDIBLE)


@pytest.mark.parametrize("robot", [SPACE, WEIGHTLESS])
def test_any_gravity_is_plausible_for_floating_robots_or_without_gravity_in_the_file(robot) -> None:  # type: ignore[no-untyped-def]
    assert implausible("gravity", "base", {"x": 0.0, "y": 0.0, "z": -9.81}, robot) == ""


def test_a_torque_limit_far_below_the_required_torque_is_not_credible() -> None:
    assert implausible("torque_saturation", "joint1", {"limit": 0.0055}, ARM, needed=1.2)
    assert not implausible("torque_saturation", "joint1", {"limit": 1.1}, ARM, needed=1.2)


def test_stated_parameters_equal_those_of_the_written_file() -> None:
    link = ARM.links[-1]
    stated = [
        ParameterChange(f"{link.name}.mass", "kg", link.mass, link.mass, (-1.0, 50.0)),
        ParameterChange(f"{link.name}.inertia.zz", "kg m^2", 0.1, -0.007, (-0.0077, -0.0071)),
        ParameterChange("viscous_friction@joint1.coefficient", "N m s/rad", 1.0, 2.0, (1.9, 2.1)),
    ]
    mass, friction = in_the_file(stated, ARM, standard=False)
    assert mass.estimate == link.mass
    assert mass.ci95 == (0.0, 50.0)
    assert friction == stated[2]
    assert in_the_file(stated, ARM, standard=True) == ()


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
def test_body_errors_of_typical_drawings_are_plausible(
    name: str, nominal: float, estimate: float, expected: bool
) -> None:
    robot = load_robot("flexible_space_robot")
    assert is_credible_number(name, estimate, nominal, robot) == expected


def test_gyro_scale_is_plausible_on_every_axis() -> None:
    rows = [credible_range("sensor_gain", "gain_error", f"base.angular_velocity.{axis}") for axis in "xyz"]
    assert all(row is not None and row.high == 0.05 for row in rows)
