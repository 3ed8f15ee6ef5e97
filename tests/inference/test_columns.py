"""Columns of terms along a recording."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_arm import recorded, wave

from missing_physics.hypotheses import Term
from missing_physics.inference.torques.columns import columns_of
from missing_physics.inference.torques.data import TorqueData
from missing_physics.standard import fit_standard
from reference_model.effects.catalogue import get_effect
from robot_model import Robot

#: With and without states, linear or not, at the joint and at a sensor, in both recordings and in one.
TERMS = (
    ("torque_ripple", "joint", {"order": 7.0, "cosine": -0.3, "sine": 0.2}, None),
    ("stribeck_friction", "joint", {}, None),
    ("lugre_friction", "joint", {}, None),
    ("cable_spring", "joint", {"stiffness": 1.5}, None),
    ("external_torque", "joint", {"torque": 2.0, "start": 4.0}, 1),
    ("sensor_gain", "joint.position", {"gain_error": 0.01}, None),
    ("payload", "link", {"mass": 0.3, "x": 0.2}, None),
)


@pytest.fixture
def data(arm: Robot) -> TorqueData:
    fit, held_out = recorded(wave, seed=1), recorded(wave, seed=2)
    return TorqueData.of(fit_standard(arm, [fit]), [fit], [held_out])


@pytest.fixture
def terms(arm: Robot) -> list[Term]:
    link = arm.links[0].name
    found = []
    for effect, at, values, run in TERMS:
        entry = get_effect(effect)
        given = {p.name: p.typical for p in entry.parameters} | values
        found.append(Term.of(entry, link if at == "link" else at, given, run=run))
    return found


@pytest.mark.parametrize("run", [0, 1])
def test_columns_of_all_terms_computed_together_equal_those_computed_one_by_one(
    data: TorqueData, terms: list[Term], run: int
) -> None:
    data.terms.prepare(terms, run)
    counted = data.runs[run].rows.counted[:, :, None]
    for term in terms:
        alone = np.where(counted, columns_of(term, data.runs[run], run), 0.0)
        assert data.columns(term, run) == pytest.approx(alone, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("run", [0, 1])
def test_torques_alone_equal_the_first_columns_of_the_derivatives(
    data: TorqueData, terms: list[Term], run: int
) -> None:
    quickly = data.terms.contributed(terms, run)
    whole = sum(data.columns(term, run)[:, :, 0] for term in terms)
    assert np.abs(whole).max() > 0.1
    assert quickly == pytest.approx(whole, rel=1e-9, abs=1e-12)


def test_linear_parameters_scale_the_first_column_only(data: TorqueData, terms: list[Term]) -> None:
    (spring,) = [term for term in terms if term.effect.id == "cable_spring"]
    before, after = (data.columns(one, 0) for one in (spring, spring.moved({"stiffness": 3.0})))
    assert after[:, :, 1:] == pytest.approx(before[:, :, 1:])
    fresh = np.where(
        data.runs[0].rows.counted[:, :, None],
        columns_of(spring.moved({"stiffness": 3.0}), data.runs[0], 0),
        0.0,
    )
    assert after == pytest.approx(fresh, rel=1e-9, abs=1e-12)


def test_linearisations_share_only_columns_that_are_the_same(data: TorqueData, terms: list[Term]) -> None:
    """Columns for other masses, friction and delays, after those of the first linearisation were cached."""
    every = [*terms, Term.of(get_effect("actuator_lag"), "joint", {"time_constant": 0.01})]
    data.terms.prepare(every, 0)
    other = data.start.copy()
    other[data.layout.names.index("link.inertia.zz")] *= 1.5
    other[data.layout.names.index("joint.coulomb")] += 0.2
    heavier = data.about(other)
    later = data.about(other + np.eye(other.size)[-1] * 4e-3)
    assert not np.allclose(later.runs[0].torque, heavier.runs[0].torque, atol=1e-3)
    for here in (heavier, later):
        counted = here.runs[0].rows.counted[:, :, None]
        for term in every:
            alone = np.where(counted, columns_of(term, here.runs[0], 0), 0.0)
            assert here.columns(term, 0) == pytest.approx(alone, rel=1e-12, abs=1e-15)
    lag = every[-1]
    assert not np.allclose(heavier.columns(lag, 0), data.columns(lag, 0), atol=1e-3)


@pytest.mark.parametrize("gain", [0.13, -0.1])
def test_torque_gain_is_relative_to_the_commanded_torque(data: TorqueData, gain: float) -> None:
    """The motion needs (1 + gain) u, so that u lacks gain / (1 + gain) of it."""
    run = data.runs[0]
    term = Term.of(get_effect("torque_gain"), "joint", {"gain_error": gain})
    found = columns_of(term, run, 0)[:, 0]
    needed = run.reduce_at(0, run.needed)[:, 0]
    assert found[:, 0] == pytest.approx(-gain / (1.0 + gain) * needed, rel=1e-6, abs=1e-9)
    assert found[:, 1] == pytest.approx(-needed / (1.0 + gain) ** 2, rel=1e-5, abs=1e-9)


def test_ripple_is_relative_to_the_torque_that_compensates_it(data: TorqueData) -> None:
    """The motion needs u + (a + r u) cos(k q), so that u lacks some of the ripple itself."""
    run, order, cogging, share = data.runs[0], 3.0, 0.4, 0.2
    values = {"order": order, "cosine": cogging, "sine": 0.0, "cosine_per_torque": share}
    term = Term.of(get_effect("torque_ripple"), "joint", values)
    wave, needed = np.cos(order * run.motion.position[:, 0]), run.needed[:, 0]
    u = (needed - cogging * wave) / (1.0 + share * wave)
    expected = run.reduce_at(0, np.column_stack([u - needed, -u * wave / (1.0 + share * wave)]))
    found = columns_of(term, run, 0)[:, 0]
    by_share = 1 + [p.name for p in term.free].index("cosine_per_torque")
    assert found[:, [0, by_share]] == pytest.approx(expected, rel=1e-5, abs=1e-9)


def test_gear_share_of_friction_is_relative_to_the_torque_that_overcomes_it(data: TorqueData) -> None:
    """u = needed + share |u| sgn(v): more than the share of what is needed if driving, less if braking."""
    run, share = data.runs[0], 0.3
    term = Term.of(get_effect("load_dependent_friction"), "joint", {"coefficient": 0.0, "gear_share": share})
    sign, needed = run.motion.direction[:, 0], run.needed[:, 0]
    u = needed / (1.0 - share * sign * np.sign(needed))
    expected = run.reduce_at(0, (share * np.abs(u) * sign)[:, None])[:, 0]
    sure = run.rows.counted[:, 0]
    found = columns_of(term, run, 0)[:, 0, 0]
    assert np.abs(found - expected)[sure].max() < 1e-6 * np.abs(expected).max()
