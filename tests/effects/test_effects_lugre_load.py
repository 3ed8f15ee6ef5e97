"""LuGre and Stribeck friction with load-dependent level, against the law in surface coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from effect_cases import Array
from scipy.integrate import solve_ivp

from reference_model.effects.along import EffectAlong
from reference_model.effects.base import JointEffect, JointSignals
from reference_model.effects.catalogue import get_effect

RADIUS = 0.04
MU_D, MU_S, V_S = 0.10, 0.15, 0.01
SIGMA = (1e4, 100.0, 0.4)  # 1/m, s/m, s/m
#: The same numbers in joint units.
LOADED = {
    "coulomb_torque": 0.0,
    "static_torque": 0.0,
    "stribeck_velocity": V_S / RADIUS,
    "bristle_stiffness": 0.0,
    "bristle_damping": 0.0,
    "load_coefficient": MU_D,
    "load_static_coefficient": MU_S,
    "load_stiffness": SIGMA[0] * RADIUS,
    "load_damping": SIGMA[1] * RADIUS,
    "load_viscosity": SIGMA[2] * RADIUS,
    "damping_limit": 0.0,
}


def along(effect_id: str = "lugre_friction") -> EffectAlong:
    effect = get_effect(effect_id)
    assert isinstance(effect, JointEffect)
    return EffectAlong(effect, bearing_arms=(RADIUS, 0.0))


def signals(time: Array, velocity: Array, load: Array | float, torque: Array | float = 0.0) -> Array:
    """Rows for a bearing whose load moment is `load` [N m]."""
    rows = np.zeros((time.size, len(JointSignals.CHANNELS)))
    for name, values in (
        ("time", time),
        ("velocity", velocity),
        ("radial_sum", np.asarray(load) / RADIUS),
        ("torque", torque),
    ):
        rows[:, JointSignals.CHANNELS.index(name)] = values
    return rows


def speed(t: float | Array) -> Array:
    return np.asarray(0.3 * np.sin(2 * np.pi * np.asarray(t)) + 0.05 * np.sin(9 * np.asarray(t)))


def moment(t: float | Array) -> Array:
    return np.asarray(30 + 20 * np.cos(7 * np.asarray(t)))


def test_in_joint_units_it_equals_the_law_in_surface_coordinates() -> None:
    """T = -W (s0 zeta + s1 zetad + s2 v), zetad = v - s0 |v| zeta / mu g, v = R qd (Liu et al. 2015)."""
    time = np.linspace(0, 1, 4001)

    def parts(t: float, zeta: float) -> tuple[float, float]:
        v = RADIUS * float(speed(t))
        level = MU_D + (MU_S - MU_D) * np.exp(-((v / V_S) ** 2))
        rate = v - SIGMA[0] * abs(v) * zeta / level
        return rate, SIGMA[0] * zeta + SIGMA[1] * rate + SIGMA[2] * v

    run = solve_ivp(
        lambda t, z: [parts(t, z[0])[0]], (0, 1), [0.0], method="Radau", t_eval=time, rtol=1e-9, atol=1e-13
    )
    wanted = [-float(moment(t)) * parts(t, z)[1] for t, z in zip(time, run.y[0])]
    found = along().torque(signals(time, speed(time), moment(time)), LOADED)
    # Signals run linearly between samples here: 4000 samples of a curvature of up to 30 rad/s^3, and an
    # interval may add 1e-4 of the largest torque, 7 N m.
    np.testing.assert_allclose(found, wanted, rtol=0, atol=7.0 * 1e-3)


@pytest.mark.parametrize("effect_id", ["lugre_friction", "stribeck_friction"])
def test_a_preload_is_a_constant_part_of_the_level(effect_id: str) -> None:
    time, preload = np.linspace(0, 1, 2000), 12.0
    if effect_id == "stribeck_friction":
        names = ("coulomb_torque", "static_torque", "stribeck_velocity", "load_coefficient")
        loaded = {name: LOADED[name] for name in (*names, "load_static_coefficient")}
    else:
        loaded = LOADED
    constant = {
        "coulomb_torque": MU_D * preload,
        "static_torque": MU_S * preload,
        "bristle_stiffness": LOADED["load_stiffness"] * preload,
        "bristle_damping": LOADED["load_damping"] * preload,
    }
    part = {**loaded, **{name: value for name, value in constant.items() if name in loaded}}
    whole = along(effect_id).torque(signals(time, speed(time), moment(time) + preload), loaded)
    both = along(effect_id).torque(signals(time, speed(time), moment(time)), part)
    viscous = loaded.get("load_viscosity", 0.0) * preload * speed(time)  # what a preload makes viscous
    # One and the same equation; the floors of 1e-9 N m and 1e-6 N m of load differ.
    np.testing.assert_allclose(both - viscous, whole, rtol=0, atol=1e-6)


@pytest.mark.parametrize("velocity", [-0.5, -0.01, 0.05, 2.0])
def test_steady_sliding_is_the_level_function(velocity: float) -> None:
    time = np.linspace(0, 5, 50)
    given = {**LOADED, "gear_share": 0.03, "coulomb_torque": 1.0, "static_torque": 1.4}
    fall = np.exp(-((velocity * RADIUS / V_S) ** 2))
    level = 1.0 + 0.4 * fall + 25 * (MU_D + (MU_S - MU_D) * fall) + 0.03 * 40
    rows = signals(time, np.full(50, velocity), 25.0, torque=-40.0)
    stribeck = {name: given[name] for name in given if name in _names("stribeck_friction")}
    found = along("stribeck_friction").torque(rows, stribeck, transition=1e-6)
    np.testing.assert_allclose(found, -level * np.sign(velocity), rtol=1e-12)
    viscous = 25.0 * LOADED["load_viscosity"] * velocity
    steady = along().torque(rows, given)[-1]
    assert steady == pytest.approx(-level * np.sign(velocity) - viscous, rel=1e-6)  # floor of the load


def _names(effect_id: str) -> set[str]:
    return {p.name for p in get_effect(effect_id).parameters}


def test_a_vanishing_load_does_not_change_the_bristle_state() -> None:
    """The sliding deflection does not depend on the load, so friction follows the load at once."""
    time = np.linspace(0, 2, 4000)
    load = 20 * np.clip(np.abs(time - 1) - 0.2, 0, None)
    found = along().torque(signals(time, np.full(time.size, 0.1), load), LOADED)
    fall = np.exp(-((0.1 * RADIUS / V_S) ** 2))
    level = MU_D + (MU_S - MU_D) * fall + SIGMA[2] * RADIUS * 0.1
    # The floors stand for 1 % of the deflection while there is no load, and it is made good over 1e-3 rad.
    settled = (time < 0.8) | (time > 1.3)
    np.testing.assert_allclose(found[settled], -level * load[settled], rtol=0, atol=1e-4)
    assert np.all(np.abs(found[load == 0]) < 1e-5)


def test_load_dependent_parameters_are_not_estimated() -> None:
    for effect_id, count in (("lugre_friction", 5), ("stribeck_friction", 3)):
        effect = get_effect(effect_id)
        assert len(effect.estimated) == count
        assert all(not p.name.startswith(("load", "gear", "damping_")) for p in effect.estimated)


@pytest.mark.parametrize("limit", [0.0, 1.0])
def test_a_cycle_never_generates_energy(limit: float) -> None:
    """Over whole cycles of speed and load, damping far above the bound of a constant one."""
    rate = 10.0
    time = np.linspace(0, 6 / rate, 60001)
    given = {**LOADED, "load_damping": 100.0, "damping_limit": limit}
    velocity = 0.3 * np.sin(2 * np.pi * rate * time)
    load = 30 + 25 * np.cos(2 * np.pi * rate * time + 1.0)
    torque = along().torque(signals(time, velocity, load), given)
    power = torque * velocity
    steps = (power[1:] + power[:-1]) / 2 * np.diff(time)
    cycles = steps.reshape(6, -1).sum(axis=1)
    assert np.all(cycles < 0)
    # What comes out within a cycle is at most what bent bristles hold, mu_s^2 W / (2 load_stiffness), and
    # what a load adds that rises while they are bent, as much again. Constant damping breaks that bound.
    held = 2 * MU_S**2 * 55 / (2 * LOADED["load_stiffness"])
    work = np.concatenate([[0.0], np.cumsum(steps)])
    out = np.max(work - np.minimum.accumulate(work))
    assert (out <= held) == (limit == 1.0)
