"""Effects that change mass properties or gravity."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from effect_cases import BODY, named, typical
from hypothesis import given, settings
from hypothesis import strategies as st

from reference_model.effects.base import BodyEffect, BodyTerms
from reference_model.effects.catalogue import get_effect

NUMBERS = st.floats(-10, 10)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS)


def _values(terms: BodyTerms) -> np.ndarray:
    """Mass, first moment, inertia and gravity in one array."""
    parts = [ca.SX(terms.mass), terms.first_moment, ca.vec(ca.SX(terms.inertia)), terms.gravity]
    return np.asarray(ca.evalf(ca.densify(ca.vertcat(*(ca.densify(part) for part in parts))))).ravel()


def _body(effect_id: str) -> BodyEffect:
    effect = get_effect(effect_id)
    assert isinstance(effect, BodyEffect)
    return effect


@settings(max_examples=40)
@given(mass=NUMBERS, point=VECTORS, velocity=VECTORS, rotation=VECTORS)
def test_a_payload_has_the_kinetic_energy_of_a_point_mass(
    mass: float,
    point: tuple[float, float, float],
    velocity: tuple[float, float, float],
    rotation: tuple[float, float, float],
) -> None:
    numbers = _values(_body("payload").terms({"mass": mass, "x": point[0], "y": point[1], "z": point[2]}))
    m, first, inertia = numbers[0], numbers[1:4], numbers[4:13].reshape(3, 3)
    v, w = np.array(velocity), np.array(rotation)
    energy = 0.5 * m * v @ v + v @ np.cross(w, first) + 0.5 * w @ inertia @ w
    of_the_point = v + np.cross(w, point)
    # Terms up to 1e6 may cancel.
    assert energy == pytest.approx(0.5 * mass * of_the_point @ of_the_point, rel=1e-9, abs=1e-7)


@pytest.mark.parametrize("effect", BODY, ids=named)
@settings(max_examples=20)
@given(data=st.data())
def test_linear_parameters_act_linearly(effect: BodyEffect, data: st.DataObject) -> None:
    linear = [p.name for p in effect.parameters if p.linear]
    fixed = {"x": 0.5, "y": -0.2, "z": 1.0} if effect.id == "payload" else {}
    first, second = ({n: data.draw(NUMBERS) for n in linear} for _ in range(2))
    mixed = {n: first[n] + 2.5 * second[n] for n in linear}
    parts = [_values(effect.terms(typical(effect, **{**fixed, **p}))) for p in (first, second, mixed)]
    np.testing.assert_allclose(parts[2], parts[0] + 2.5 * parts[1], rtol=0, atol=1e-11)


@pytest.mark.parametrize("effect", BODY, ids=named)
def test_absent_parameters_add_nothing(effect: BodyEffect) -> None:
    absent = typical(effect, **{p.name: p.absent for p in effect.parameters if p.absent is not None})
    assert np.all(_values(effect.terms(absent)) == 0)


def test_the_inertia_tensor_is_symmetric_with_entries_in_order() -> None:
    effect = _body("inertia")
    values = {p.name: float(k) for k, p in enumerate(effect.parameters, start=1)}
    numbers = _values(effect.terms(values))
    assert list(numbers[:4]) == [1.0, 2.0, 3.0, 4.0]
    expected = np.array([[5.0, 8.0, 9.0], [8.0, 6.0, 10.0], [9.0, 10.0, 7.0]])
    np.testing.assert_array_equal(numbers[4:13].reshape(3, 3), expected)
    assert np.all(numbers[13:] == 0)


def test_gravity_is_added_unchanged() -> None:
    numbers = _values(_body("gravity").terms({"x": 1.0, "y": 2.0, "z": 3.0}))
    assert list(numbers) == [0.0] * 13 + [1.0, 2.0, 3.0]
