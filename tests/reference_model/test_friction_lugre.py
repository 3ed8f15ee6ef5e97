"""Published properties of LuGre friction: break-away, pre-sliding, lag, Stribeck curve, passivity."""

from __future__ import annotations

import numpy as np
import pytest
from sliding_blocks import MASS, block, ramp

from reference_model.effects.along import EffectAlong
from reference_model.effects.base import JointEffect, JointSignals
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate

#: The numbers of Canudas de Wit et al., IEEE TAC 40 (1995) 419-425, table I.
PUBLISHED = {
    "coulomb_torque": 1.0,
    "static_torque": 1.5,
    "stribeck_velocity": 1e-3,
    "bristle_stiffness": 1e5,
    "bristle_damping": np.sqrt(1e5),
}
VISCOUS = 0.4


def friction(time: np.ndarray, velocity: np.ndarray, **changes: float) -> np.ndarray:
    """Friction force against the motion along a given speed."""
    effect = get_effect("lugre_friction")
    assert isinstance(effect, JointEffect)
    signals = np.zeros((time.size, len(JointSignals.CHANNELS)))
    signals[:, 0], signals[:, 2] = time, velocity
    return -EffectAlong(effect).torque(signals, {**PUBLISHED, **changes})


def pulled(rate: float):
    """A block pulled with a force that rises at `rate` [N/s], by a spring too soft to feel the block."""
    stiffness, duration = 1e-2, 2.5 / rate + 0.05
    robot = block(
        {"effect": "lugre_friction", "at": "slide", **PUBLISHED},
        {"effect": "viscous_friction", "at": "slide", "coefficient": VISCOUS},
        controller={"kind": "pd", "kp": stiffness, "kd": 0.0},
        motion=[ramp("slide", rate / stiffness, duration)],
        duration=duration,
        rate=4000 / duration,
    )
    return simulate(robot, sensors=False)


def test_break_away_friction_decreases_with_the_force_rate() -> None:
    peaks = []
    for rate in (0.5, 2.0, 5.0, 10.0):
        recording = pulled(rate)
        force = -recording["slide.friction_torque"]
        peak = int(np.argmax(force[recording["slide.velocity"] < 0.01]))
        rising = force[:peak]
        assert np.all(np.diff(rising[:: max(peak // 50, 1)]) > 0)
        # Pre-sliding: until then it has moved by some break-away deflections, Fs / s0 = 15 micrometres.
        assert recording["slide.position"][peak] < 20 * 1.5e-5
        assert force[peak : peak + 400].min() < force[peak] - 0.05
        peaks.append(force[peak])
    # Between the kinetic and the static level, and falling with the rate (break-away as published).
    assert np.all(np.diff(peaks) < -0.02)
    assert 1.4 < peaks[0] < 1.5
    assert 1.0 < peaks[-1] < 1.3


@pytest.mark.parametrize("amplitude", [3e-6, 1e-5, 5e-5])
def test_presliding_loops_close_with_dahls_area(amplitude: float) -> None:
    """Between -A and A at a constant level F_c: area 4 F_c (A - F_m/s0), F_m = F_c tanh(s0 A / F_c)."""
    time = np.linspace(0, 16, 32001)
    position = amplitude * np.sin(2 * np.pi * time)
    velocity = 2 * np.pi * amplitude * np.cos(2 * np.pi * time)
    force = friction(time, velocity, static_torque=1.0, bristle_damping=0.0)
    cycles = force[:-1].reshape(16, 2000)
    # The last loop is the one before: closed, to what a step of 1e-4 of the force may leave.
    np.testing.assert_allclose(cycles[-1], cycles[-2], atol=1e-3)
    last = slice(30000, 32001)
    area = np.trapezoid(force[last], position[last])
    level, stiffness = 1.0, PUBLISHED["bristle_stiffness"]
    turning = level * np.tanh(stiffness * amplitude / level)
    expected = 4 * level * (amplitude - turning / stiffness)
    assert force[last].max() == pytest.approx(turning, rel=1e-3)
    # Quadrature and steps: 1e-4 of the force over a path of 4 A.
    assert area == pytest.approx(expected, abs=1e-3 * 4 * amplitude * turning)


def test_small_loops_vanish_with_the_cube_of_the_amplitude() -> None:
    """Dahl's area for small A is 4/3 s0^2 A^3 / F_c."""
    areas, amplitudes = [], np.array([5e-7, 1e-6])
    for amplitude in amplitudes:
        time = np.linspace(0, 2, 40001)
        velocity = 2 * np.pi * amplitude * np.cos(2 * np.pi * time)
        force = friction(time, velocity, static_torque=1.0, bristle_damping=0.0)[20000:]
        areas.append(np.trapezoid(force, amplitude * np.sin(2 * np.pi * time[20000:])))
    np.testing.assert_allclose(areas, 4 / 3 * 1e10 * amplitudes**3, rtol=0.05)  # (s0 A / F_c)^2 terms, 1 %


@pytest.mark.parametrize("rate", [1.0, 10.0, 25.0])
def test_friction_lags_behind_the_speed(rate: float) -> None:
    """Sliding one way at changing speed: friction is larger while the speed rises (Hess and Soom, 1990)."""
    time = np.linspace(0, 3 * 2 * np.pi / rate, 30001)
    velocity = 2e-3 + 1e-3 * np.sin(rate * time)
    force = friction(time, velocity)[20000:]
    speed, rises = velocity[20000:], np.cos(rate * time[20000:]) > 0
    at = np.linspace(1.2e-3, 2.8e-3, 30)
    order = np.argsort(speed[rises])
    up = np.interp(at, speed[rises][order], force[rises][order])
    order = np.argsort(speed[~rises])
    down = np.interp(at, speed[~rises][order], force[~rises][order])
    assert np.all(up > down)
    # To first order bristles lag by their own time g/(s0 v), made shorter by the damping s1/s0, so the two
    # branches differ by 2 |dg/dv| |dv/dt| (g/(s0 v) - s1/s0); the next order is (rate g/(s0 v))^2.
    if rate == 1.0:
        v, level = 2e-3, 1 + 0.5 * np.exp(-4)
        damping = np.sqrt(1e5) / (1 + np.sqrt(1e5) * v / (4 * level))
        lag = level / (1e5 * v) - damping / 1e5
        slope = 0.5 * 2 * v / 1e-6 * np.exp(-4)
        found = np.interp(v, at, up - down)
        assert found == pytest.approx(2 * slope * 1e-3 * rate * lag, rel=0.05)


def test_steady_sliding_is_the_stribeck_curve() -> None:
    for velocity in (1e-4, 5e-4, 1e-3, 3e-3, 0.1):
        time = np.linspace(0, 20 * 1.5 / (1e5 * velocity), 400)  # 20 times the bristles' own time
        force = friction(time, np.full(400, velocity))
        level = 1.0 + 0.5 * np.exp(-((velocity / 1e-3) ** 2))
        assert force[-1] == pytest.approx(level, rel=1e-6)


def test_no_cycle_generates_energy_in_the_loop_with_the_load() -> None:
    """A block dragged to and fro: over every period friction takes work out."""
    mu = 0.1
    robot = block(
        {
            "effect": "lugre_friction",
            "at": "slide",
            "coulomb_torque": 0.0,
            "static_torque": 0.0,
            "stribeck_velocity": 0.01,
            "bristle_stiffness": 0.0,
            "bristle_damping": 0.0,
            "load_coefficient": mu,
            "load_static_coefficient": 0.15,
            "load_stiffness": 1e4,
            "load_damping": 100.0,
            "load_viscosity": 0.4,
        },
        controller={"kind": "pd", "kp": 500.0, "kd": 5.0},
        motion=[
            {
                "joint": "slide",
                "kind": "multisine",
                "amplitudes": (0.02,),
                "frequencies": (1.0,),
                "ramp": 0.5,
            }
        ],
        duration=4.0,
        rate=2000.0,
    )
    recording = simulate(robot, sensors=False)
    power = recording["slide.friction_torque"] * recording["slide.velocity"]
    work = ((power[1:] + power[:-1]) / 2 / 2000.0).reshape(4, -1).sum(axis=1)
    travelled = np.abs(recording["slide.velocity"][:-1]).reshape(4, -1).sum(axis=1) / 2000.0
    # About the kinetic level times the travel, and the static and viscous parts above it.
    assert np.all(work < -mu * MASS * 9.81 * travelled)
    # It is never a source by more than its bristles hold, mu_s^2 W / (2 load_stiffness), in any stretch.
    total = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2 / 2000.0)])
    held = 0.15**2 * MASS * 9.81 / (2 * 1e4)
    assert np.max(total - np.minimum.accumulate(total)) < 1.1 * held
