"""Sensor effects: readings of a faulty sensor, and its first-order error."""

from __future__ import annotations

import numpy as np
import pytest
from effect_cases import SENSOR, named, typical
from hypothesis import given, settings
from hypothesis import strategies as st

from reference_model.effects.along import SensorAlong
from reference_model.effects.base import SensorEffect
from reference_model.effects.catalogue import get_effect

TIME = np.linspace(0.0, 4.0, 8001)
VALUE = np.sin(3.0 * TIME) + 0.3 * np.cos(7.0 * TIME)
RATE = 3.0 * np.cos(3.0 * TIME) - 2.1 * np.sin(7.0 * TIME)


def _sensor(effect_id: str) -> SensorEffect:
    effect = get_effect(effect_id)
    assert isinstance(effect, SensorEffect)
    return effect


@pytest.mark.parametrize("effect", SENSOR, ids=named)
def test_an_absent_fault_changes_nothing(effect: SensorEffect) -> None:
    absent = typical(effect, **{p.name: p.absent for p in effect.parameters if p.absent is not None})
    assert np.all(SensorAlong(effect).error(TIME, VALUE, RATE, absent) == 0)
    np.testing.assert_allclose(effect.apply(TIME, VALUE, absent), VALUE, rtol=0, atol=1e-15)


@pytest.mark.parametrize("effect", SENSOR, ids=named)
def test_the_error_is_the_fault_to_first_order(effect: SensorEffect) -> None:
    linear = [p for p in effect.parameters if p.linear]
    inner = slice(400, -400)  # a shift in time has nothing to read beyond the ends
    misses = []
    for part in (1.0, 0.5):
        parameters = typical(effect, **{p.name: part * 4e-3 for p in linear})
        predicted = SensorAlong(effect).error(TIME, VALUE, RATE, parameters)
        measured = effect.apply(TIME, VALUE, parameters) - VALUE
        misses.append(np.max(np.abs(measured - predicted)[inner]))
        assert np.max(np.abs(predicted)) > 1e-4
    # What is left is of second order: half the fault leaves a quarter. The interpolation between samples
    # 0.5 ms apart errs by up to 1e-6.
    assert misses[1] <= 0.3 * misses[0] + 1e-6


@pytest.mark.parametrize("effect", SENSOR, ids=named)
@settings(max_examples=10)
@given(data=st.data())
def test_linear_parameters_act_linearly(effect: SensorEffect, data: st.DataObject) -> None:
    linear = [p.name for p in effect.parameters if p.linear]
    first, second = ({n: data.draw(st.floats(-10, 10)) for n in linear} for _ in range(2))
    mixed = {n: first[n] + 2.5 * second[n] for n in linear}
    errors = [
        SensorAlong(effect).error(TIME, VALUE, RATE, typical(effect, **p)) for p in (first, second, mixed)
    ]
    # Rounding of numbers below 1e3.
    np.testing.assert_allclose(errors[2], errors[0] + 2.5 * errors[1], rtol=0, atol=1e-11)


def test_offset_and_gain() -> None:
    np.testing.assert_allclose(_sensor("sensor_offset").apply(TIME, VALUE, {"offset": 0.2}), VALUE + 0.2)
    np.testing.assert_allclose(_sensor("sensor_gain").apply(TIME, VALUE, {"gain_error": 0.2}), 1.2 * VALUE)


def test_a_delayed_channel_reports_earlier_values() -> None:
    measured = _sensor("sensor_delay").apply(TIME, VALUE, {"delay": 0.0123})
    before = TIME - 0.0123
    expected = np.sin(3.0 * before) + 0.3 * np.cos(7.0 * before)
    # Monotone cubic interpolation of samples h = 0.5 ms apart, second order at extremes: h^2 f''/8 = 6e-7.
    np.testing.assert_allclose(measured[25:], expected[25:], rtol=0, atol=1e-6)
    # Before the first sample the first one is held.
    np.testing.assert_array_equal(measured[:24], VALUE[0])


def test_a_delay_of_whole_samples_is_a_shift() -> None:
    measured = _sensor("sensor_delay").apply(TIME, VALUE, {"delay": 10 * 5e-4})
    np.testing.assert_allclose(measured[10:], VALUE[:-10], rtol=0, atol=1e-12)


def test_a_jump_is_delayed_without_ringing() -> None:
    square = np.sign(np.sin(5 * TIME))
    measured = _sensor("sensor_delay").apply(TIME, square, {"delay": 1.3e-3})
    assert np.max(np.abs(measured)) <= 1.0


def test_clock_drift_accumulates_over_time() -> None:
    measured = _sensor("clock_drift").apply(TIME, 2.0 * TIME, {"rate": 1e-3})
    np.testing.assert_allclose(measured[:-10], 2.0 * (1 + 1e-3) * TIME[:-10], rtol=0, atol=1e-12)


def test_missing_samples_do_not_spread() -> None:
    holed = VALUE.copy()
    holed[100:120] = np.nan
    measured = _sensor("sensor_delay").apply(TIME, holed, {"delay": 2e-3})
    assert np.all(np.isfinite(measured))
    nothing = np.full(5, np.nan)
    assert np.all(np.isnan(_sensor("sensor_delay").apply(TIME[:5], nothing, {"delay": 1e-3})))


def test_an_eccentric_disc_has_a_once_per_turn_error() -> None:
    angle = np.linspace(0, 2 * np.pi, 721)
    measured = _sensor("encoder_eccentricity").apply(
        angle, angle, {"cosine": 3e-3, "sine": 4e-3, "order": 1.0}
    )
    error = measured - angle
    assert np.max(error) == pytest.approx(5e-3, rel=1e-4)
    assert error[0] == pytest.approx(error[-1], abs=1e-15)
