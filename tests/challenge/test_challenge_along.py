"""Torques along a motion: the hidden effects explain the torques recorded by the other engine."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from challenge_cases import ARM, AXIS, design, hiding
from quick_ones import quick_places

from exudyn_model import simulate
from missing_physics.challenge.scoring.information import (
    IDENTIFIABLE,
    _changed,
    _nominal_columns,
    _residual_energy,
    _rivals,
    distances,
)
from missing_physics.challenge.torques.along import ArmAlong
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import catalogue
from robot_model import EffectUse, Recording, Robot, robot_from_toml, robot_to_toml


def motion_of(robot: Robot) -> Recording:
    """The motion of a robot, simulated once for all tests that look at it."""
    return _once(robot_to_toml(robot.model_copy(update={"sensors": ()})))


@cache
def _once(text: str) -> Recording:
    return simulate(robot_from_toml(text), sensors=False)


HIDDEN = [
    (
        "stribeck_friction",
        "joint1",
        ARM,
        {"coulomb_torque": 3.0, "static_torque": 5.0, "stribeck_velocity": 0.1},
    ),
    ("torque_ripple", "joint2", ARM, {"cosine": 1.0, "sine": -0.5, "order": 9.0}),
    ("payload", "link2", ARM, {"mass": 1.0, "x": 0.4, "y": 0.01, "z": 0.0}),
    ("gravity", "base", ARM, {"x": 0.2, "y": 0.0, "z": -0.1}),
    ("cable_spring", "joint1", AXIS, {"stiffness": 60.0, "torque_at_zero": 4.0}),
]


@pytest.mark.parametrize(("effect", "at", "number", "values"), quick_places(HIDDEN, 0, 2, 4))
def test_effect_torques_equal_the_difference_of_exudyn_simulations(
    effect: str, at: str, number: int, values: dict
) -> None:
    case = hiding(effect, at, number, **values)
    along = ArmAlong(case.nominal, motion_of(case.real))
    missing = along.torque - along.nominal()
    part = along.part(case.hidden[0])
    assert np.abs(part).max() > 0.1
    # The engines agree to about 1e-7 of the torque; dry friction at its reversals to 1e-3.
    assert np.sqrt(np.mean((missing - part) ** 2)) < 1e-3 * np.sqrt(np.mean(part**2))


def test_position_error_changes_the_torque_through_its_derivatives() -> None:
    """First order: the inverse dynamics of the shifted motion less that of the true one."""
    robot = design(ARM).nominal.model_copy(update={"effects": ()})
    along = ArmAlong(robot, motion_of(robot))
    use = EffectUse.model_validate({"effect": "sensor_offset", "at": "joint2.position", "offset": 1e-5})
    q, v, a = along.state
    shifted = along.model.inverse_dynamics(q + np.array([0.0, 1e-5]), v, a)
    difference = along.rigid - shifted
    assert np.allclose(along.part(use), difference, atol=1e-3 * np.abs(difference).max())


def test_every_hidden_effect_has_rivals_of_finite_distance() -> None:
    """Whatever the catalogue says looks alike, gears and structures included, must not stop a score."""
    robot = design(ARM).nominal.model_copy(update={"effects": ()})
    along = ArmAlong(robot, motion_of(robot))
    weighed = 0
    for effect in catalogue().values():
        if not effect.along_motion or isinstance(effect, GearEffect):
            continue
        at = {"link": "link2", "base": "base", "sensor": "joint2.position"}.get(effect.place, "joint2")
        typical = {p.name: p.typical for p in effect.parameters}
        use = EffectUse.model_validate({"effect": effect.id, "at": at, **typical})
        weighed += sum(1 for _ in _rivals(along, use))
    assert weighed > 50


def test_residual_energy_equals_closed_forms() -> None:
    rng = np.random.default_rng(3)
    target, column = rng.normal(size=50), rng.normal(size=(50, 1))
    none = np.zeros((50, 0))
    c, t = column[:, 0], target
    assert _residual_energy(t, none, none) == pytest.approx(t @ t)
    assert _residual_energy(t, none, column) == pytest.approx(t @ t - (c @ t) ** 2 / (c @ c))
    # Woodbury: t' (1 + c c')^-1 t
    assert _residual_energy(t, column, none) == pytest.approx(
        t @ np.linalg.solve(np.eye(50) + np.outer(c, c), t)
    )
    assert _residual_energy(3 * c, none, np.hstack([column, column])) == pytest.approx(
        0.0, abs=1e-9 * (c @ c)
    )


def distance(*effect: str, number: int = AXIS, noise: float = 1.0, **values: float) -> float:
    case = hiding(*effect, number, **values)
    sensors = tuple(s.model_copy(update={"noise": noise * s.noise}) for s in case.nominal.sensors)
    case = case.model_copy(update={"nominal": case.nominal.model_copy(update={"sensors": sensors})})
    along = ArmAlong(case.nominal, motion_of(case.real))
    return next(iter(distances(along, case.hidden).values()))


def test_distance_decreases_with_the_square_of_the_noise() -> None:
    one = distance("coulomb_friction", "joint1", torque=8.0)
    ten = distance("coulomb_friction", "joint1", torque=8.0, noise=10.0)
    assert one > IDENTIFIABLE
    # Credible errors of the nominal robot and the resolution do not grow with the noise.
    assert 0.005 < ten / one < 0.05


def test_plausible_error_of_a_mass_is_a_fraction_of_its_inertial_force() -> None:
    """On a horizontal axis without friction: 0.3 m a, whatever is hidden elsewhere."""
    case = hiding("coulomb_friction", "joint1", torque=8.0)
    along = ArmAlong(case.nominal, motion_of(case.real))
    wanted = 0.3 * case.nominal.links[0].mass * along.state[2]
    columns = list(_nominal_columns(along, case.hidden[0]))
    assert sum(np.allclose(column, wanted, rtol=1e-9) for column in columns) == 1
    heavier = EffectUse.model_validate({"effect": "inertia", "at": case.nominal.links[0].name, "mass": 1.0})
    assert not any(np.allclose(c, wanted, rtol=1e-9) for c in _nominal_columns(along, heavier))


def test_equivalent_effects_cannot_be_distinguished() -> None:
    """An offset of the drive and one of its sensor are the same to every recording."""
    assert distance("torque_offset", "joint1", torque=5.0) < IDENTIFIABLE
    assert distance("sensor_gain", "joint1.torque", gain_error=0.05) < IDENTIFIABLE


def test_weak_effects_cannot_be_determined() -> None:
    assert distance("coulomb_friction", "joint1", torque=1e-4) < IDENTIFIABLE


def test_only_the_changed_parameter_differs() -> None:
    use = EffectUse.model_validate({"effect": "payload", "at": "link1", "mass": 1.0, "x": 0.2})
    expected = EffectUse.model_validate({"effect": "payload", "at": "link1", "mass": 3.0, "x": 0.2})
    assert _changed(use, "mass", 3.0) == expected
    assert use.parameters["mass"] == 1.0
