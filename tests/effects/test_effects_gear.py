"""Gear effects in isolation: energy, loss, play, loops."""

from __future__ import annotations

import itertools

import casadi as ca
import numpy as np
import pytest
from effect_cases import GEAR, named, typical
from hypothesis import given
from hypothesis import strategies as st
from quick_ones import quick_places

from reference_model.effects.base import GearEffect, GearSignals
from reference_model.effects.catalogue import get_effect
from reference_model.effects.gear_hysteresis import GearHysteresis

STIFFNESS, DAMPING = 3e4, 20.0
#: Before a loop closes: each turn of amplitude A leaves exp(-4 A / travel) of the first one.
TURNS = 6
TWISTS = st.floats(-3e-3, 3e-3)
RATES = st.floats(-0.2, 0.2)
STATES = st.floats(-1.0, 1.0)


def values_of(effect: GearEffect) -> dict[str, float]:
    """Typical values with a spring of its own."""
    return typical(effect, stiffness=STIFFNESS, damping=DAMPING)


class Law:
    """The functions of an effect, of twist, rate and state."""

    def __init__(self, effect: GearEffect, p: dict[str, float]) -> None:
        d, v, z = ca.SX.sym("d"), ca.SX.sym("v"), ca.SX.sym("z", effect.states)
        s = effect.behind(GearSignals(d, v), p)
        elastic, stored = effect.elastic(s, p, z), effect.stored(s, p, z)
        change = ca.jacobian(stored, d) * v + ca.jacobian(stored, z) @ effect.state_rate(s, p, z)
        parts = [elastic, effect.viscous(s, p), stored, effect.loss(s, p, z), change]
        self._function = ca.Function("law", [d, v, z], parts)

    def __call__(self, d: float, v: float, z: float = 0.0) -> tuple[float, ...]:
        return tuple(float(part) for part in self._function(d, v, z))


LAWS = {effect.id: Law(effect, values_of(effect)) for effect in GEAR}


@pytest.mark.parametrize("effect", GEAR, ids=named)
@given(d=TWISTS, v=RATES, z=STATES)
def test_power_is_stored_or_lost(effect: GearEffect, d: float, v: float, z: float) -> None:
    elastic, viscous, _, loss, change = LAWS[effect.id](d, v, z)
    power = (elastic + viscous) * v
    # rounding of sums of numbers of the size of T v
    assert power == pytest.approx(change + loss, abs=1e-12 * (1 + abs(elastic * v) + abs(viscous * v)))
    assert loss >= -1e-15


@pytest.mark.parametrize("effect", GEAR, ids=named)
@given(d=TWISTS)
def test_at_rest_a_gear_has_a_restoring_torque_and_stores_energy(effect: GearEffect, d: float) -> None:
    elastic, viscous, stored, loss, _ = LAWS[effect.id](d, 0.0)
    assert elastic * d >= 0
    assert stored >= 0
    assert viscous == loss == 0.0


@pytest.mark.parametrize("effect", GEAR, ids=named)
def test_without_the_effect_only_the_spring_remains(effect: GearEffect) -> None:
    absent = {p.name: p.absent for p in effect.parameters if p.absent is not None and p.name != "damping"}
    law = Law(effect, {**values_of(effect), **absent})
    for d in (-1e-3, 2e-4):
        elastic, viscous, *_ = law(d, 0.1, 0.7)
        assert elastic == pytest.approx(STIFFNESS * d, rel=1e-12)
        assert viscous == pytest.approx(DAMPING * 0.1, rel=1e-12)


@given(d=st.floats(-5e-4, 5e-4), v=RATES)
def test_no_torque_is_transmitted_within_the_play(d: float, v: float) -> None:
    elastic, viscous, stored, *_ = Law(get_effect("backlash"), {**values_of(get_effect("backlash"))})(d, v)
    assert elastic == viscous == stored == 0.0


def around(law: Law, effect: GearHysteresis, p: dict[str, float], amplitude: float, steps: int) -> float:
    """Area of the settled loop of a slowly swinging twist [J]; z is exact for monotonous pieces."""
    angle = np.linspace(0.0, 2 * np.pi * TURNS, TURNS * steps + 1)
    twist = amplitude * np.sin(angle)
    z, torque = 0.0, [law(0.0, 0.0, 0.0)[0]]
    for before, after in itertools.pairwise(twist):
        side = np.sign(after - before)
        z = side + (z - side) * np.exp(-abs(after - before) / p["travel"])
        torque.append(law(float(after), 0.0, float(z))[0])
    last = slice((TURNS - 1) * steps, None)
    return float(np.trapezoid(np.array(torque)[last], twist[last]))


@pytest.mark.parametrize("amplitude", quick_places([5e-5, 3e-4, 2e-3], 1))
def test_the_area_of_the_hysteresis_loop_matches_the_closed_form(amplitude: float) -> None:
    effect = GearHysteresis()
    p = values_of(effect)
    travel = p["travel"]
    area = around(Law(effect, p), effect, p, amplitude, 4_000)
    # between the ends z is 1 - (1 + Z) exp(-(d + A)/travel) with Z = tanh(A/travel)
    expected = 4 * p["torque"] * (amplitude - travel * np.tanh(amplitude / travel))
    # trapezoids of twists (2 pi A / 4000) over curves of the size of the travel, and exp(-10) unsettled
    assert area == pytest.approx(expected, rel=1e-3)
