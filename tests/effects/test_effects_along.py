"""Effects along a motion: derivatives, states, step formulas, blocks."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from effect_cases import ARMS, JOINT, SENSOR, motion, named, typical
from scipy.linalg import expm

from reference_model.effects.along import EffectAlong, SensorAlong
from reference_model.effects.base import JointEffect, JointSignals, Parameter, SensorEffect, Values
from reference_model.effects.catalogue import get_effect
from reference_model.effects.scan import Scan
from reference_model.effects.stepping import step


def _difference(function: Callable[[float], np.ndarray], value: float, scale: float) -> np.ndarray:
    h = 1e-5 * scale
    return (function(value + h) - function(value - h)) / (2 * h)


#: Central differences of step 1e-5 (relative) err by about 1e-10 from the third derivative and 1e-11 from
#: rounding, both relative to the largest derivative; edges in time multiply the former by 1e3 or so.
DIFFERENCES = 1e-5


@pytest.mark.parametrize("effect", JOINT, ids=named)
def test_jacobian_of_joint_effects(effect: JointEffect) -> None:
    along = EffectAlong(effect, gear_ratio=100.0, bearing_arms=ARMS, transition=1e-2)
    signals, parameters = motion(), typical(effect)
    names = tuple(p.name for p in effect.estimated)
    torque, jacobian = along.evaluate(signals, parameters, names)
    assert jacobian.shape == (len(signals), len(names))
    np.testing.assert_array_equal(torque, along.torque(signals, parameters))
    np.testing.assert_array_equal(jacobian, along.jacobian(signals, parameters, names))
    for k, parameter in enumerate(effect.estimated):
        expected = _difference(
            lambda x, name=parameter.name: along.torque(signals, {**parameters, name: x}),  # type: ignore[misc]
            parameters[parameter.name],
            parameter.typical,
        )
        scale = max(np.max(np.abs(expected)), 1e-12)
        np.testing.assert_allclose(jacobian[:, k] / scale, expected / scale, rtol=0, atol=DIFFERENCES)


@pytest.mark.parametrize("effect", SENSOR, ids=named)
def test_jacobian_of_sensor_effects(effect: SensorEffect) -> None:
    along = SensorAlong(effect)
    time, value, rate = motion()[:, :3].T
    parameters = typical(effect)
    names = tuple(p.name for p in effect.estimated)
    jacobian = along.jacobian(time, value, rate, parameters, names)
    for k, parameter in enumerate(effect.estimated):
        expected = _difference(
            lambda x, name=parameter.name: along.error(time, value, rate, {**parameters, name: x}),  # type: ignore[misc]
            parameters[parameter.name],
            parameter.typical,
        )
        scale = max(np.max(np.abs(expected)), 1e-12)
        np.testing.assert_allclose(jacobian[:, k] / scale, expected / scale, rtol=0, atol=DIFFERENCES)


def test_columns_follow_the_requested_order() -> None:
    along = EffectAlong(_joint("stribeck_friction"))
    parameters = typical(along.effect)
    names = ("stribeck_velocity", "coulomb_torque")
    whole = along.jacobian(motion(), parameters, tuple(p.name for p in along.effect.estimated))
    np.testing.assert_array_equal(along.jacobian(motion(), parameters, names), whole[:, [2, 0]])


def test_transition_can_be_given_with_each_call() -> None:
    coulomb = EffectAlong(_joint("coulomb_friction"), transition=1e-4)
    signals = motion()
    np.testing.assert_allclose(
        coulomb.torque(signals, {"torque": 2.0}, transition=0.5),
        -2.0 * np.tanh(signals[:, 2] / 0.5),
        rtol=1e-13,
    )


def _joint(effect_id: str) -> JointEffect:
    effect = get_effect(effect_id)
    assert isinstance(effect, JointEffect)
    return effect


@pytest.mark.parametrize("time_constant", [1e-4, 5e-3, 0.3])
def test_a_lag_is_exact_for_a_ramp(time_constant: float) -> None:
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(1e-4, 2e-2, 600))  # uneven on purpose
    signals = np.zeros((600, len(JointSignals.CHANNELS)))
    signals[:, 0], signals[:, 4] = time, 3.0 + 20.0 * time
    added = EffectAlong(_joint("actuator_lag")).torque(signals, {"time_constant": time_constant})
    lag = time_constant + 1e-6
    # Started in step with the command: z - u = -slope * lag * (1 - exp(-t/lag)).
    expected = -20.0 * lag * (1 - np.exp(-(time - time[0]) / lag))
    # The step is exact for a linear command; u itself is of the order 100, so rounding is near 1e-13.
    np.testing.assert_allclose(added, expected, rtol=0, atol=1e-11)


class TwoStage(JointEffect):
    """Two lags in a row: an effect with two states."""

    id = "two_stage"
    title = "Two lags"
    place = "actuator"
    parameters = (Parameter("time_constant", "s", "of each", 1e-4, 1.0, 0.02),)
    equation = "two lags"
    source = "test"
    signature = "lag"
    experiment = "none"
    states = 2

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return z[1]

    def state_rate(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return ca.vertcat(s.torque - z[0], z[0] - z[1]) / p["time_constant"]


def test_an_effect_with_two_states() -> None:
    time = np.linspace(0, 1, 200)
    signals = np.zeros((200, len(JointSignals.CHANNELS)))
    signals[:, 0], signals[:, 4] = time, 1.0
    along = EffectAlong(TwoStage())
    torque, jacobian = along.evaluate(signals, {"time_constant": 0.02}, ("time_constant",))
    x = time / 0.02
    # Step response of two equal lags, and its derivative by the time constant: divided steps keep an
    # interval's error below 1e-4 of the largest value; some intervals' errors add up.
    np.testing.assert_allclose(torque, 1 - (1 + x) * np.exp(-x), rtol=0, atol=1e-3)
    np.testing.assert_allclose(jacobian[:, 0], -(x**2) * np.exp(-x) / 0.02, rtol=0, atol=2e-3 * 0.54 / 0.02)


@pytest.mark.parametrize("count", [1, 2])
def test_steps_are_of_second_order(count: int) -> None:
    """Halving the step divides the error by four, for a non-linear rate that depends on the signals."""

    def rate(z: ca.SX, row: ca.SX) -> ca.SX:
        swap = z if count == 1 else ca.vertcat(z[1], -z[0])
        return ca.sin(swap) - z**2 + row[1] * ca.vertcat(*([1.0, 0.5][:count]))

    z, u0, u1 = ca.SX.sym("z", count), ca.SX.sym("u0", 2), ca.SX.sym("u1", 2)
    function = ca.Function("f", [z, u0, u1], [step(rate, z, u0, u1, u1[0] - u0[0])])

    def end(steps: int) -> np.ndarray:
        time = np.linspace(0, 2, steps + 1)
        rows = np.column_stack([time, time])  # a signal that is linear in time, as the formulas assume
        state = np.array([0.3, -0.2])[:count]
        for a, b in itertools.pairwise(rows):
            state = function(state, a, b).full().ravel()
        return state

    exact = end(2560)
    errors = [np.linalg.norm(end(steps) - exact) for steps in (20, 40, 80)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    # The leading term rules at these steps; the next one bends the order by some percent.
    assert np.all(orders > 1.8), orders


@pytest.mark.parametrize("count", [1, 2])
def test_very_stiff_states_follow_their_moving_equilibrium(count: int) -> None:
    def rate(z: ca.SX, row: ca.SX) -> ca.SX:
        return -1e9 * (z - row[1])

    z, u0, u1 = ca.SX.sym("z", count), ca.SX.sym("u0", 2), ca.SX.sym("u1", 2)
    function = ca.Function("f", [z, u0, u1], [step(rate, z, u0, u1, u1[0] - u0[0])])
    state = np.full(count, 5.0)
    for k in range(3):
        state = function(state, [k * 1e-3, 2.0 * k], [(k + 1) * 1e-3, 2.0 * (k + 1)]).full().ravel()
    # Rest is u minus its rate over the stiffness, 2e-6; an L-stable step forgets the start.
    np.testing.assert_allclose(state, 6.0, rtol=0, atol=1e-5)


@pytest.mark.parametrize("length", [1, 2, 256, 257, 258, 600])
def test_a_scan_equals_a_loop_for_any_length(length: int) -> None:
    x, a, b, c = ca.SX.sym("x", 2), ca.SX.sym("a", 3), ca.SX.sym("b", 3), ca.SX.sym("c", 1)
    turn = expm(np.array([[0, 1], [-1, 0]]))
    function = ca.Function("f", [x, a, b, c], [turn @ x + ca.vertcat(a[0] * b[1], c * b[2])])
    rng = np.random.default_rng(0)
    rows, constants = rng.normal(size=(length, 3)), np.array([0.3])
    expected = [np.array([1.0, 2.0])]
    for before, after in itertools.pairwise(rows):
        expected.append(turn @ expected[-1] + [before[0] * after[1], 0.3 * after[2]])
    np.testing.assert_allclose(Scan(function)(expected[0], rows, constants), expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("effect", JOINT, ids=named)
@pytest.mark.parametrize("samples", [2, 3])
def test_very_short_motions(effect: JointEffect, samples: int) -> None:
    names = tuple(p.name for p in effect.estimated)
    torque, jacobian = EffectAlong(effect, bearing_arms=ARMS).evaluate(
        motion(samples=samples), typical(effect), names
    )
    assert np.all(np.isfinite(torque))
    assert np.all(np.isfinite(jacobian))


def test_a_chain_uses_the_cheap_step_only_where_it_is_valid() -> None:
    """Where the fast function is not valid, the result is that of the reliable one."""
    x, begin, end, constants = (ca.SX.sym(name, size) for name, size in zip("xbec", (2, 2, 2, 1)))
    sure = ca.vertcat(ca.cos(x[1]) * constants, x[0] + end[0] - begin[0])
    holds = begin[1]
    wrong = ca.if_else(holds == 1, sure, ca.SX([np.nan, 7.0]))
    inputs = [x, begin, end, constants]
    step, easy = ca.Function("step", inputs, [sure]), ca.Function("easy", inputs, [wrong, holds])
    rng = np.random.default_rng(3)
    # Alone, in stretches, at the very end, and not at all; NaN does not hold either.
    kinds = (rng.random(1000) < 0.98, np.arange(1000) % 200 > 90, np.arange(1000) < 999, np.zeros(1000))
    for k, kind in enumerate(kinds):
        marks = np.where(kind, 1.0, np.nan if k % 2 else 0.0)
        rows = np.column_stack([rng.normal(size=1000), marks])
        first, fixed = np.array([0.3, -0.2]), np.array([0.9])
        np.testing.assert_array_equal(Scan(step, easy)(first, rows, fixed), Scan(step)(first, rows, fixed))


@pytest.mark.parametrize("effect", JOINT, ids=named)
def test_signals_that_an_effect_does_not_use_do_not_change_it(effect: JointEffect) -> None:
    """With the parameters zero that a robot file need not state, such as shares of the bearing's load."""
    along = EffectAlong(effect, gear_ratio=100.0, bearing_arms=ARMS, transition=1e-2)
    zero = frozenset(p.name for p in effect.parameters if p.default == 0.0)
    signals, parameters = motion(), {**typical(effect), **dict.fromkeys(zero, 0.0)}
    used = along.channels_without(zero)
    assert used <= along.channels
    other = signals.copy()
    for k, name in enumerate(JointSignals.CHANNELS):
        if name not in used and name != "time":  # the intervals over which states are integrated
            other[:, k] *= 1.7
    np.testing.assert_array_equal(along.torque(signals, parameters), along.torque(other, parameters))


def test_friction_without_a_share_of_the_load_needs_no_load() -> None:
    lugre = EffectAlong(get_effect("lugre_friction"), bearing_arms=ARMS)
    shares = frozenset(("load_coefficient",))
    zero = frozenset(p.name for p in lugre.effect.parameters if p.default == 0.0)
    assert "radial_sum" in lugre.channels
    assert "radial_sum" in lugre.channels_without(shares)
    assert lugre.channels_without(zero) == {"velocity"}
