"""Numbers by runs: steps, and starts that are far off."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from end_to_end_cases import ARM, AXIS, QUICK, otherwise
from hypothesis import given
from hypothesis import strategies as st

from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.passive.runs import _with
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs import numbers as run_numbers
from missing_physics.diagnosis.runs.fit import RunFit, _grown, errors_of, fit_in_runs
from missing_physics.diagnosis.runs.nominal import MOST, Combinations
from missing_physics.diagnosis.runs.spreads import spread_of
from missing_physics.diagnosis.terms.point_masses import nearest_point
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot


@pytest.mark.proof
def test_a_load_far_from_where_it_is_thought_is_found() -> None:
    """Runs tell its mass times its place squared best: the valley along which both keep it is curved."""
    real = ARM.with_effects(EffectUse(effect="payload", at="link2", mass=2.0, x=0.35, y=0.02, z=0.0))
    recordings = [simulate(r, seed=k) for k, r in enumerate((real, otherwise(real)))]
    replay = Replay.of(ARM, recordings[:1], recordings[1:])
    assert replay is not None
    start = Term(get_effect("payload"), "link2", {"mass": 0.2, "x": 0.8, "y": 0.0, "z": 0.0}, unseen=("z",))
    described = errors_of(replay, ARM)
    assert described is not None
    fit = fit_in_runs(replay, [start], partial(_with, replay), described)
    assert fit is not None
    # a mean of N squares of standard normal numbers scatters by sqrt(2 / N); five of those
    assert fit.energy / fit.errors.size == pytest.approx(1.0, abs=5 * np.sqrt(2 / fit.errors.size))
    off = np.abs(fit.values - [2.0, 0.35, 0.02])
    assert np.all(off < 4 * fit.spread)


def test_what_is_brief_arrives_where_errors_are_least() -> None:
    """Half a second's push moves a recording by its noise only when runs are no longer linear in it."""
    push = Term(
        get_effect("external_torque"), "joint2", {"torque": 3.0, "start": 6.2, "duration": 0.5, "edge": 0.01}
    )
    replay = Replay.of(ARM, [simulate(_with(cast(Replay, SimpleNamespace(robot=ARM)), [push]), seed=1)])
    described = None if replay is None else errors_of(replay, ARM)
    assert replay is not None
    assert described is not None
    start = push.at_values(np.array([3.0103, 6.20024, 0.4933]))  # what a regression said
    fit = fit_in_runs(replay, [start], partial(_with, replay), described, most_runs=20)
    assert fit is not None
    gradient = fit.columns.T @ fit.errors / np.linalg.norm(fit.columns, axis=0)
    assert np.abs(gradient).max() < 0.1  # of a standard deviation, that of noise
    assert np.all(np.abs(fit.values - push.values) < 4 * fit.spread)


@pytest.mark.parametrize("shown", [1.0, 1.02], ids=["the same law", "a law that is another one there"])
def test_numbers_are_as_sure_as_held_out_recordings_let_them_be(shown: float) -> None:
    """What a law is not quite moves its numbers otherwise along another motion."""
    plain = ARM.model_copy(update={"effects": ()})

    def robot(size: float) -> Robot:
        return plain.with_effects(EffectUse(effect="viscous_friction", at="joint1", coefficient=size))

    recordings = [simulate(robot(2.0), seed=20), simulate(otherwise(robot(2.0 * shown)), seed=21)]
    replay = Replay.of(plain, recordings[:1], recordings[1:])
    assert replay is not None
    start = Term(get_effect("viscous_friction"), "joint1", {"coefficient": 1.0})
    described = errors_of(replay, plain)
    assert described is not None
    fit = fit_in_runs(replay, [start], partial(_with, replay), described)
    assert fit is not None
    (found,) = spread_of(replay, fit, partial(_with, replay))
    (white,) = fit.spread
    assert fit.values[0] == pytest.approx(2.0, abs=4 * white)
    assert white < 2e-3  # so that 4e-2 more stand out
    if shown == 1.0:
        # the other recording knows the number about as well: it differs by four of both spreads at most
        assert white <= found < 6 * white
    else:
        assert found == pytest.approx(4e-2, rel=0.2)


@pytest.mark.parametrize("left", [5.0, 500.0], ids=["something else is missing", "next to nothing is right"])
def test_held_out_recordings_are_asked_where_something_else_is_missing(left: float) -> None:
    """A law that is another one there shows it; far from everything no number is told."""
    time, noise = np.linspace(0.0, 1.0, 400), np.random.default_rng(7).normal(size=400)
    along = (np.sin(20 * time), np.cos(13 * time))
    wave = np.sqrt(2 * left) * np.sin(55 * time)

    def errors(robot: float, which: int, *, keep: bool = True) -> dict[str, np.ndarray]:
        return {"joint1.torque": noise + wave + (50.0 + 3.0 * which - robot) * along[which]}

    asked = SimpleNamespace(recording=time)
    replay: Any = SimpleNamespace(
        fitted=1, made=0, asked=(asked, asked), channels=("joint1.torque",), errors=errors
    )
    start = Term(get_effect("viscous_friction"), "joint1", {"coefficient": 50.0})
    columns = -along[0][:, None]
    fit = RunFit((start,), errors(50.0, 0)["joint1.torque"], columns, np.arange(400) // 40, (1.0,))

    def with_it(terms: Sequence[Term]) -> Robot:
        return cast(Robot, terms[0].parameters["coefficient"])

    (found,) = spread_of(replay, fit, with_it)
    (alone,) = fit.spread
    replay.asked = (asked, asked, asked)
    replay.errors = lambda robot, which, **_: errors(robot, which) if which < 2 else None
    assert spread_of(replay, fit, with_it) == pytest.approx(found)  # one that cannot be run says nothing
    if left < 100.0:
        assert found > 2.5
    else:
        assert found == pytest.approx(np.hypot(alone, fit.step[0]))


def test_a_fit_that_has_not_arrived_is_no_surer_than_what_it_has_to_go() -> None:
    noise = np.random.default_rng(8).normal(size=(400, 1))
    terms = (Term(get_effect("viscous_friction"), "joint1", {"coefficient": 1.0}),)
    fit = RunFit(terms, noise[:, 0] + 0.5, np.full((400, 1), -1.0), np.arange(400) // 40, (1.0,))
    replay: Any = SimpleNamespace(fitted=1, asked=(None,))
    (found,) = spread_of(replay, fit, lambda _: None)
    assert fit.spread[0] == pytest.approx(0.05, rel=1.0)  # of 400 numbers, or of ten blocks of them
    # half a unit, but for what the noise's mean is, a twentieth
    assert found == pytest.approx(0.5, abs=0.2)


def test_what_one_block_of_time_holds_is_as_sure_as_noise_lets_it_be() -> None:
    """Without that block nothing tells a push, and blocks would call it unknown."""
    plain = ARM.model_copy(update={"effects": ()})
    push = EffectUse(effect="external_torque", at="joint1", torque=8.0, start=2.02, duration=0.2)
    replay = Replay.of(plain, [simulate(plain.with_effects(push), seed=22)])
    assert replay is not None
    start = Term(get_effect("external_torque"), "joint1", {**push.parameters, "torque": 7.0})
    described = errors_of(replay, plain)
    assert described is not None
    fit = fit_in_runs(replay, [start], partial(_with, replay), described)
    assert fit is not None
    assert np.all(fit.spread < 0.02 * np.abs(fit.values))
    assert np.all(np.abs(fit.values - [8.0, 2.02, 0.2]) < 5 * fit.spread)


@pytest.mark.proof
def test_a_name_has_the_numbers_that_runs_tell() -> None:
    """Where these leave noise; a regression tells the stiffness of this spring to 1 N/m."""
    plain = AXIS.model_copy(update={"effects": ()})
    spring = EffectUse(effect="cable_spring", at="joint1", stiffness=600.0, torque_at_zero=-8.0)
    real = plain.with_effects(spring)
    recordings = [simulate(r, seed=k) for k, r in enumerate((real, otherwise(real)))]
    found = diagnose(plain, recordings[:1], recordings[1:], options=QUICK).diagnosis
    [finding] = found.findings
    assert (finding.effect, finding.location) == ("cable_spring", "joint1")
    for name, value, width in (("stiffness", 600.0, 1.0), ("torque_at_zero", -8.0, 0.06)):
        low, high = finding.parameters[name].ci95
        # an interval of 95 %, and half of it more
        assert low - 0.25 * (high - low) < value < high + 0.25 * (high - low)
        assert high - low < width  # 1.5 and 0.07 by a regression


@given(st.floats(1e-6, 1e6), st.floats(-50.0, 50.0))
def test_a_size_that_counts_by_its_logarithm_stays_positive(value: float, relative: float) -> None:
    change = _grown(np.array([value]), np.array([value * relative]), np.zeros(1))
    assert value + change[0] >= 0
    assert np.sign(change[0]) == np.sign(relative * value)


@given(st.floats(-1e6, 1e6).filter(lambda x: abs(x) > 1e-6), st.floats(-50.0, 50.0))
def test_a_number_with_a_sign_goes_as_far_as_it_must(value: float, relative: float) -> None:
    """About as far as asked, also through zero."""
    change = _grown(np.array([value]), np.array([value * relative]), np.full(1, -np.inf))
    # exp(1) - 2 is what a step by 1 goes further
    assert abs(change[0] / value - relative) < np.exp(1) - 2 + 1e-6 * abs(relative)


def test_small_steps_are_what_they_were() -> None:
    values, step = np.array([3.0, -2.0]), np.array([3e-6, 1e-6])
    assert _grown(values, step, np.array([0.0, -np.inf])) == pytest.approx(step, rel=1e-5)


def test_a_point_of_mass_has_the_mass_properties_that_are_stated() -> None:
    """Of ten numbers three are told: a mass, a first moment and a moment of inertia."""
    told = {"mass": 8.0, "first_moment_x": 8.0 * 4.5, "inertia_zz": 8.0 * 4.5**2}
    inertia = get_effect("inertia")
    values = {**{p.name: 0.0 for p in inertia.parameters}, **told}
    unseen = tuple(p.name for p in inertia.parameters if p.name not in told)
    found = nearest_point(
        Term(inertia, "link1", values, unseen=unseen),
        {name: 1e-3 * value for name, value in told.items()},
        Term(get_effect("payload"), "link1", {"mass": 0.0, "x": 9.0, "y": 0.0, "z": 0.0}),
    )
    assert found.parameters["mass"] == pytest.approx(8.0, rel=1e-6)
    assert found.parameters["x"] == pytest.approx(4.5, rel=1e-6)


def test_a_combination_that_runs_do_not_tell_is_as_uncertain_as_it_may_be(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """No variance of it would make it known, and tell links apart by it."""
    effect = Combinations(2)
    own = Term(effect, "robot", {p.name: 0.0 for p in effect.estimated}, nominal=True)
    columns = np.zeros((400, 2))
    columns[:, 0] = np.random.default_rng(9).normal(size=400)
    fit = RunFit((own,), columns[:, 0], columns, np.arange(400) // 40, (1.0, 1.0))
    kept: list[np.ndarray] = []
    monkeypatch.setattr(run_numbers, "fit_in_runs", lambda *_, **__: fit)
    monkeypatch.setattr(run_numbers, "spread_of", lambda *_: np.array([0.05, np.inf]))
    monkeypatch.setattr(run_numbers, "freed", lambda _, terms, covariance: kept.append(covariance))
    nothing: Any = None
    replay: Any = SimpleNamespace(robot=ARM, costly=False)
    run_numbers.refined(replay, nothing, [own], nothing, nothing, most_runs=10)
    assert kept[0] == pytest.approx(np.diag([0.05**2, MOST**2]))
