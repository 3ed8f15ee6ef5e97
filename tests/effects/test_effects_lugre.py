"""LuGre friction against closed forms."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from effect_cases import Array, motion
from quick_ones import quick_places
from scipy.integrate import solve_ivp

from reference_model.effects.along import EffectAlong
from reference_model.effects.base import JointEffect, JointSignals
from reference_model.effects.catalogue import get_effect

FRICTION = {
    "coulomb_torque": 5.0,
    "static_torque": 7.0,
    "stribeck_velocity": 0.02,
    "bristle_stiffness": 1e4,
    "bristle_damping": 20.0,
}


def _along() -> EffectAlong:
    effect = get_effect("lugre_friction")
    assert isinstance(effect, JointEffect)
    return EffectAlong(effect)


def _signals(time: Array, velocity: Array, position: Array | None = None) -> Array:
    signals = np.zeros((time.size, len(JointSignals.CHANNELS)))
    signals[:, 0], signals[:, 2] = time, velocity
    signals[:, 1] = 0.0 if position is None else position
    return signals


def _level(velocity: Array | float) -> Array:
    return np.asarray(5.0 + 2.0 * np.exp(-((np.asarray(velocity) / 0.02) ** 2)))


@pytest.mark.parametrize("velocity", [-1.0, -0.02, 1e-3, 0.01, 0.3])
def test_sliding_at_constant_speed_is_the_stribeck_curve(velocity: float) -> None:
    time = np.linspace(0, 1, 50)
    torque = _along().torque(_signals(time, np.full(50, velocity)), FRICTION, transition=1e-6)
    # The bristles start in their sliding state, so this holds from the first sample; rounding, and the
    # floor of 1e-9 N m under the level.
    np.testing.assert_allclose(torque, -_level(velocity) * np.sign(velocity), rtol=0, atol=1e-8)


def test_break_away_at_constant_speed_follows_the_exponential() -> None:
    velocity, start = 1e-3, 1e-12
    time = np.r_[0.0, start + np.linspace(0, 3.0, 400)]
    torque = _along().torque(_signals(time, np.r_[0.0, np.full(400, velocity)]), FRICTION)
    s0, level = FRICTION["bristle_stiffness"], float(_level(velocity))
    # Closed form at constant speed: z = z_ss + (z_0 - z_ss) exp(-s0 |v| t / g) with z_0 = 0.
    z = level / s0 * (1 - np.exp(-s0 * velocity * time / level))
    damping = 20.0 / (1 + 20.0 * velocity / (4 * level))
    expected = -(s0 * z + damping * (velocity - s0 * velocity * z / level))
    # The step is exact at constant speed, up to the start of the motion.
    np.testing.assert_allclose(torque[1:], expected[1:], rtol=0, atol=1e-8)


def test_below_break_away_the_joint_is_a_spring() -> None:
    time = np.linspace(0, 1, 2000)
    travel = 1e-7  # against a break-away deflection of 7e-4 rad
    position = travel * (1 - np.cos(2 * np.pi * time)) / 2
    velocity = travel * np.pi * np.sin(2 * np.pi * time)
    torque = _along().torque(_signals(time, velocity, position), {**FRICTION, "bristle_damping": 0.0})
    # Bristles that have bent by a share of 1.4e-4 of break-away have slid by that share at most.
    np.testing.assert_allclose(torque, -1e4 * position, rtol=0, atol=1e4 * travel * 5e-4)


def test_dahl_loops_do_not_depend_on_the_rate() -> None:
    dahl = {**FRICTION, "static_torque": 5.0, "bristle_damping": 0.0}
    share = np.linspace(0, 2, 3000)
    position = 1e-3 * np.sin(2 * np.pi * share)
    torques = []
    for duration in (1.0, 50.0):
        velocity = 1e-3 * 2 * np.pi * np.cos(2 * np.pi * share) / duration
        signals = _signals(share * duration, velocity, position)
        torques.append(_along().torque(signals, dahl, transition=1e-12))
    # Both runs make the same steps in terms of travel; what is left is rounding.
    np.testing.assert_allclose(torques[0], torques[1], rtol=0, atol=1e-9)
    # A loop encloses an area: the torque at mid-travel differs between the two directions.
    assert np.ptp(torques[0]) > 5.0


@pytest.mark.parametrize("bristle_damping", [0.0, 20.0, 1e4])
def test_friction_returns_no_more_energy_than_the_bristles_store(bristle_damping: float) -> None:
    # 1e4 N m s/rad is far above the limit 4 g / |v| of a constant damping.
    signals = motion(samples=40000, duration=2.0)
    friction = {**FRICTION, "bristle_damping": bristle_damping}
    torque = _along().torque(signals, friction)
    power = torque * signals[:, 2]
    work = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(signals[:, 0]))])
    stored = 0.5 * 7.0**2 / 1e4  # s0 z^2 / 2 at the largest deflection
    # From any instant on, the work that comes out is at most what was stored then; the quadrature of this
    # many samples errs by far less than the energy stored.
    assert np.max(work - np.minimum.accumulate(work)) <= 1.02 * stored
    assert work[-1] < -1.0


def _reference(signals: Array, parameters: dict[str, float]) -> Array:
    """The same law integrated by scipy, speed linear between samples, restarted at samples and reversals."""
    time, velocity = signals[:, 0], signals[:, 2]
    s0, s1 = parameters["bristle_stiffness"], parameters["bristle_damping"]

    def rate(t: float, z: Array) -> Array:
        v = np.interp(t, time, velocity)
        return np.asarray(v - s0 * abs(v) * z / _level(v))

    z = np.array([_level(velocity[0]) / s0 * np.tanh(velocity[0] / 1e-4)])
    deflections = [z[0]]
    for i in range(time.size - 1):
        cuts = [time[i], time[i + 1]]
        if velocity[i] * velocity[i + 1] < 0:
            cuts.insert(1, time[i] + np.diff(cuts)[0] * velocity[i] / (velocity[i] - velocity[i + 1]))
        for span in itertools.pairwise(cuts):
            z = solve_ivp(rate, span, z, method="Radau", rtol=1e-7, atol=1e-12).y[:, -1]
        deflections.append(z[0])
    zs, level = np.array(deflections), _level(velocity)
    damping = s1 / (1 + s1 * np.abs(velocity) / (4 * level))
    return np.asarray(-(s0 * zs + damping * (velocity - s0 * np.abs(velocity) * zs / level)))


@pytest.mark.parametrize(
    ("stiffness", "damping"), quick_places([(1e3, 5.0), (1e5, 50.0), (1e7, 100.0)], 0, 1)
)
def test_evaluation_along_a_motion_agrees_with_an_independent_integrator(
    stiffness: float, damping: float
) -> None:
    signals = motion(samples=250, duration=1.0)
    parameters = {**FRICTION, "bristle_stiffness": stiffness, "bristle_damping": damping}
    torque = _along().torque(signals, parameters)
    # An interval may add 1e-4 of the largest torque, 7 N m, and errors of a few intervals add up.
    np.testing.assert_allclose(torque, _reference(signals, parameters), rtol=0, atol=7.0 * 1e-3)


def test_it_converges_to_stribeck_friction_with_stiff_bristles() -> None:
    signals = motion(samples=2000)
    stribeck = get_effect("stribeck_friction")
    assert isinstance(stribeck, JointEffect)
    expected = EffectAlong(stribeck).torque(signals, FRICTION)
    moving = np.abs(signals[:, 2]) > 0.05
    errors = [
        np.max(np.abs(_along().torque(signals, {**FRICTION, "bristle_stiffness": s0}) - expected)[moving])
        for s0 in (1e3, 1e4, 1e5, 1e6)
    ]
    assert all(a > b for a, b in itertools.pairwise(errors))
    # Bristles lag by g/s0 of travel, 5e-6 rad here, over which the level changes by less than this.
    assert errors[-1] < 1e-2
