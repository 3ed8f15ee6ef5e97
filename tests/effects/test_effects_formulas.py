"""Joint effects against formulas written out by hand, and what holds for all of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from effect_cases import ARMS, JOINT, at_point, motion, named, typical
from hypothesis import given, settings
from hypothesis import strategies as st

from reference_model.effects.along import EffectAlong
from reference_model.effects.base import JointEffect
from reference_model.effects.catalogue import get_effect

#: Formulas are repeated in double precision, in another order of operations.
EXACT = 1e-12


def _joint(effect_id: str) -> JointEffect:
    effect = get_effect(effect_id)
    assert isinstance(effect, JointEffect)
    return effect


CASES = [
    ("viscous_friction", {"coefficient": 3.0}, {"velocity": -2.0}, 6.0),
    ("quadratic_drag", {"coefficient": 3.0}, {"velocity": -2.0}, 12.0),
    ("coulomb_friction", {"torque": 4.0}, {"velocity": 0.5}, -4.0),
    ("coulomb_friction", {"torque": 4.0}, {"velocity": -0.5}, 4.0),
    ("coulomb_friction", {"torque": 4.0}, {"velocity": 0.0}, 0.0),
    (
        "stribeck_friction",
        {"coulomb_torque": 4.0, "static_torque": 6.0, "stribeck_velocity": 0.1},
        {"velocity": 0.1},
        -(4 + 2 / math.e),
    ),
    (
        "stribeck_friction",
        {"coulomb_torque": 4.0, "static_torque": 6.0, "stribeck_velocity": 0.1},
        {"velocity": -5.0},
        4.0,
    ),
    ("asymmetric_friction", {"coulomb_difference": 1.0, "viscous_difference": 2.0}, {"velocity": 3.0}, -7.0),
    ("asymmetric_friction", {"coulomb_difference": 1.0, "viscous_difference": 2.0}, {"velocity": -3.0}, -7.0),
    ("asymmetric_friction", {"coulomb_difference": 1.0, "viscous_difference": 2.0}, {"velocity": 0.0}, 0.0),
    (
        "load_dependent_friction",
        {"coefficient": 0.1, "gear_share": 0.02},
        {"velocity": 1.0, "radial_force": 100, "axial_force": 50, "radial_sum": 300, "torque": -30},
        -(0.1 * (ARMS[0] * 300 + ARMS[1] * 50) + 0.02 * 30),
    ),
    (
        "position_dependent_friction",
        {"cosine": 2.0, "sine": 1.0, "order": 100.0},
        {"velocity": -1.0, "position": 0.3},
        2 * math.cos(30) + math.sin(30),
    ),
    (
        "temperature_dependent_friction",
        {"rate": 0.03, "reference_temperature": 293.15},
        {"friction": -10.0, "temperature": 313.15},
        -10 * (math.exp(-0.6) - 1),
    ),
    ("cable_spring", {"stiffness": 2.0, "torque_at_zero": 1.0}, {"position": 0.5}, 0.0),
    ("cable_spring", {"stiffness": 2.0, "torque_at_zero": 1.0}, {"position": 2.0}, -3.0),
    ("end_stop", {"stiffness": 50.0, "position": 1.0, "side": 1.0}, {"position": 1.2}, -10.0),
    ("end_stop", {"stiffness": 50.0, "position": 1.0, "side": 1.0}, {"position": 0.8}, 0.0),
    ("end_stop", {"stiffness": 50.0, "position": -1.0, "side": -1.0}, {"position": -1.2}, 10.0),
    (
        "torque_ripple",
        {"cosine": 1.0, "sine": 2.0, "cosine_per_torque": 0.1, "sine_per_torque": 0.2, "order": 7.0},
        {"position": 0.4, "torque": 5.0},
        1.5 * math.cos(2.8) + 3.0 * math.sin(2.8),
    ),
    ("torque_gain", {"gain_error": -0.1}, {"torque": 30.0}, -3.0),
    ("torque_offset", {"torque": 1.5}, {}, 1.5),
    ("torque_saturation", {"limit": 20.0}, {"torque": 30.0}, -10.0),
    ("torque_saturation", {"limit": 20.0}, {"torque": -30.0}, 10.0),
    ("torque_saturation", {"limit": 20.0}, {"torque": 15.0}, 0.0),
    ("external_torque", {"torque": 3.0, "start": 1.0, "duration": 0.5, "edge": 0.01}, {"time": 1.2}, 3.0),
    ("external_torque", {"torque": 3.0, "start": 1.0, "duration": 0.5, "edge": 0.01}, {"time": 1.0}, 1.5),
    ("external_torque", {"torque": 3.0, "start": 1.0, "duration": 0.5, "edge": 0.01}, {"time": 2.0}, 0.0),
]


@pytest.mark.parametrize(("effect_id", "parameters", "signals", "expected"), CASES)
def test_known_values(
    effect_id: str, parameters: dict[str, float], signals: dict[str, float], expected: float
) -> None:
    assert at_point(_joint(effect_id), parameters, **signals) == pytest.approx(expected, rel=EXACT, abs=EXACT)


def test_saturation_reduces_the_torque_little_at_the_corner() -> None:
    at_corner = at_point(_joint("torque_saturation"), {"limit": 20.0}, torque=20.0)
    assert at_corner == pytest.approx(-20 * 0.005 * math.log(2))
    assert at_point(_joint("torque_saturation"), {"limit": 1e-3}, torque=1e5) == pytest.approx(1e-3 - 1e5)


def test_without_bearing_geometry_only_gear_friction_remains() -> None:
    along = EffectAlong(_joint("load_dependent_friction"), bearing_arms=(0.0, 0.0))
    signals = motion()
    both = along.torque(signals, {"coefficient": 0.3, "gear_share": 0.1})
    share = along.torque(signals, {"coefficient": 0.0, "gear_share": 0.1})
    assert np.any(share != 0)
    np.testing.assert_array_equal(both, share)


@pytest.mark.parametrize(
    "effect_id", ["viscous_friction", "coulomb_friction", "stribeck_friction", "load_dependent_friction"]
)
@settings(max_examples=60)
@given(data=st.data())
def test_friction_is_dissipative(effect_id: str, data: st.DataObject) -> None:
    effect = _joint(effect_id)
    parameters = {
        p.name: data.draw(st.floats(max(p.lower, 1e-3), min(p.upper, 100.0))) for p in effect.parameters
    }
    loads = st.floats(0.0, 1e4)
    velocity = data.draw(st.floats(-10, 10))
    torque = at_point(
        effect,
        parameters,
        velocity=velocity,
        torque=data.draw(st.floats(-1e3, 1e3)),
        radial_force=data.draw(loads),
        axial_force=data.draw(loads),
        radial_sum=data.draw(loads),
    )
    assert torque * velocity <= 0


@settings(max_examples=60)
@given(
    level=st.floats(0, 100),
    share=st.sampled_from([-1.0, 1.0]),  # the worst ones, as the sum is linear in the share
    transitions=st.floats(-2, 2),
    transition=st.floats(1e-5, 1.0),
)
def test_asymmetric_friction_below_the_symmetric_one_is_dissipative(
    level: float, share: float, transitions: float, transition: float
) -> None:
    velocity = transitions * transition  # where the smoothed signs are between -1 and 1
    asymmetric = {"coulomb_difference": share * level, "viscous_difference": share * level}
    total = (
        at_point(_joint("coulomb_friction"), {"torque": level}, velocity=velocity, transition=transition)
        + at_point(_joint("viscous_friction"), {"coefficient": level}, velocity=velocity)
        + at_point(_joint("asymmetric_friction"), asymmetric, velocity=velocity, transition=transition)
    )
    # Rounding of a difference of numbers up to 1e3.
    assert total * velocity <= 1e-10


@pytest.mark.parametrize("effect", JOINT, ids=named)
def test_an_absent_effect_adds_nothing(effect: JointEffect) -> None:
    parameters = typical(effect, **{p.name: p.absent for p in effect.parameters if p.absent is not None})
    along = EffectAlong(effect, gear_ratio=100.0, bearing_arms=ARMS)
    signals = motion()
    added = along.torque(signals, parameters)
    # A lag of zero is a lag of one microsecond, and absent bristles hold 1e-9 N m; else nothing at all, up
    # to the tail of a rounded corner.
    rate = np.max(np.abs(np.gradient(signals[:, 4], signals[:, 0])))
    allowed = {"actuator_lag": 2e-6 * rate, "lugre_friction": 1e-8}.get(effect.id, 1e-80)
    assert np.max(np.abs(added)) <= allowed
    present = along.torque(signals, typical(effect))
    assert np.max(np.abs(present)) > 1e-3


@pytest.mark.parametrize("effect", [e for e in JOINT if any(p.linear for p in e.parameters)], ids=named)
@settings(max_examples=15)
@given(data=st.data())
def test_linear_parameters_act_linearly(effect: JointEffect, data: st.DataObject) -> None:
    along = EffectAlong(effect, gear_ratio=100.0, bearing_arms=ARMS)
    signals = motion(samples=50)
    linear = [p.name for p in effect.parameters if p.linear]
    numbers = st.floats(-1e3, 1e3)
    first = {name: data.draw(numbers) for name in linear}
    second = {name: data.draw(numbers) for name in linear}
    factor = data.draw(numbers)
    mixed = {name: first[name] + factor * second[name] for name in linear}
    parts = [along.torque(signals, typical(effect, **values)) for values in (first, second, mixed)]
    expected = parts[0] + factor * parts[1]
    # Rounding of sums whose terms may cancel: relative to the terms, not to the sum.
    scale = max(np.max(np.abs(parts[0])), abs(factor) * np.max(np.abs(parts[1])), 1e-300)
    terms = max(*(abs(v) for v in (*first.values(), *mixed.values())), 1.0) * (1 + abs(factor))
    np.testing.assert_allclose(parts[2], expected, rtol=0, atol=1e-11 * (scale + 1e3 * terms))


@pytest.mark.parametrize("effect", JOINT, ids=named)
def test_flags_match_the_dependencies_of_the_formulas(effect: JointEffect) -> None:
    along = EffectAlong(effect, gear_ratio=100.0, bearing_arms=ARMS)
    signals = motion()
    changed = signals.copy()
    changed[:, 4] *= 1.5
    assert effect.uses_torque == bool(
        np.any(along.torque(signals, typical(effect)) != along.torque(changed, typical(effect)))
        or effect.id == "torque_ripple"
    )
    changed = signals.copy()
    changed[:, 5] *= 1.5
    assert effect.is_modifier == bool(
        np.any(along.torque(signals, typical(effect)) != along.torque(changed, typical(effect)))
    )
