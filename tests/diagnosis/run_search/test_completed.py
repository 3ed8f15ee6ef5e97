"""What runs in closed loop find beside names that are not enough."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from end_to_end_cases import AXIS, FRICTION, otherwise
from rescue_cases import SPRING, term_of

from missing_physics.diagnosis.candidates.fitted import refit
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.search import Progress
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments, nominal_terms
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.run_search import rescue
from missing_physics.diagnosis.run_search.rescue import completed
from missing_physics.diagnosis.run_search.search import found_by_runs
from missing_physics.diagnosis.runs.energies import Build
from missing_physics.diagnosis.runs.numbers import best_numbers
from missing_physics.diagnosis.terms.term import Term
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot

pytestmark = pytest.mark.proof


def bench_of(
    hidden: tuple[EffectUse, ...], named: list[Term], robot: Robot, *, proof: bool = True
) -> tuple[Replay, Explanation, Build]:
    """Runs along recordings of a robot in which `hidden` is missing, and what is `named` with its numbers."""
    recordings = [
        simulate(r.with_effects(*hidden), seed=31 + k) for k, r in enumerate((robot, otherwise(robot)))
    ]
    segments = make_segments(robot, recordings)
    data = split(segments, 1, inertial_basis(robot, segments[:1]), seed=0)
    best = explain(data.problem, data.view, [*nominal_terms(robot), *named], nuisance=False)
    best = replace(best, terms=(*nominal_terms(robot), *named))  # not with the regression's numbers

    def build(explanation: Explanation) -> Robot:
        uses = [EffectUse(effect=t.effect.id, at=t.at, **t.own) for t in explanation.terms]
        return robot.model_copy(update={"effects": tuple(uses)})

    held_out = recordings[1:] if proof else []
    replay = Replay.of(robot, recordings[:1], held_out)
    assert replay is not None
    return replay, best, build


def completed_of(
    hidden: tuple[EffectUse, ...], named: list[Term], robot: Robot = AXIS, *, proof: bool = True
) -> Explanation | None:
    """What completes `named` along recordings of a robot in which `hidden` is missing."""
    found = completed(*bench_of(hidden, named, robot, proof=proof), lambda phrase: None)
    return None if found is None or not found.whole else found.explanation


@pytest.mark.parametrize("off", [1.0, pytest.param(1.2, marks=pytest.mark.proof)])
def test_the_second_of_two_effects_is_found_by_runs(off: float) -> None:
    """Whatever the first one's number is without the second."""
    lacks = AXIS.model_copy(update={"effects": ()})
    assert completed_of((FRICTION, SPRING), [term_of(FRICTION, off)], lacks, proof=False) is None
    found = completed_of((FRICTION, SPRING), [term_of(FRICTION, off)], lacks)
    assert found is not None
    named = {t.key: t.parameters for t in found.found}
    assert set(named) == {("coulomb_friction", "joint1"), ("cable_spring", "joint1")}
    # 30 N and 600 N/m are told to a hundredth by far
    assert named["coulomb_friction", "joint1"]["torque"] == pytest.approx(30.0, rel=0.01)
    assert named["cable_spring", "joint1"]["stiffness"] == pytest.approx(600.0, rel=0.01)


@pytest.mark.proof
def test_one_with_a_cycle_is_looked_for_beside_what_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes a costly search completes nothing, but runs look for it at cycles in which they differ."""
    lacks = AXIS.model_copy(update={"effects": ()})
    numbers = {"cosine": 6.0, "sine": 3.0, "cosine_per_torque": 0.0, "sine_per_torque": 0.0, "order": 80.0}
    ripple = EffectUse(effect="torque_ripple", at="joint1", **numbers)
    searches = []

    def beside(replay: Replay | None, best: Explanation, build: Build, tell: Progress) -> None:
        nothing = explain(best.problem, best.view, nominal_terms(lacks), nuisance=False)
        basis = inertial_basis(lacks, best.problem.segments)
        searches.append(found_by_runs(replay, best, nothing, basis, build, tell))

    monkeypatch.setitem(globals(), "completed", beside)
    assert completed_of((FRICTION, ripple), [term_of(FRICTION)], lacks) is None
    [found] = searches
    named = {t.key: t.parameters for t in found.explanation.found}
    assert set(named) == {("coulomb_friction", "joint1"), ("torque_ripple", "joint1")}
    for name, value in numbers.items():
        assert named["torque_ripple", "joint1"][name] == pytest.approx(value, rel=0.02, abs=0.02), name
    assert named["coulomb_friction", "joint1"]["torque"] == pytest.approx(30.0, rel=0.01)


@pytest.mark.proof
def test_two_more_are_found_beside_the_first_one() -> None:
    """Coulomb friction is named, a spring and viscous friction are not; one of these alone is not enough."""
    lacks = AXIS.model_copy(update={"effects": ()})
    wet = EffectUse(effect="viscous_friction", at="joint1", coefficient=150.0)
    found = completed_of((FRICTION, SPRING, wet), [term_of(FRICTION)], lacks)
    assert found is not None
    named = {t.key: t.parameters for t in found.found}
    assert set(named) == {(use.effect, use.at) for use in (FRICTION, SPRING, wet)}
    assert named["cable_spring", "joint1"]["stiffness"] == pytest.approx(600.0, rel=0.02)
    assert named["viscous_friction", "joint1"]["coefficient"] == pytest.approx(150.0, rel=0.02)


def test_what_is_named_needs_no_more_than_better_numbers() -> None:
    lacks = AXIS.model_copy(update={"effects": ()})
    found = completed_of((FRICTION,), [term_of(FRICTION, 0.8)], lacks)
    assert found is not None
    [term] = found.found
    assert term.parameters["torque"] == pytest.approx(30.0, rel=0.01)


def test_runs_tell_how_sure_a_number_is_that_was_guessed_right() -> None:
    lacks = AXIS.model_copy(update={"effects": ()})
    sure = term_of(FRICTION)
    for term in (sure, replace(sure, held={"torque": sure.parameters["torque"]})):
        replay, best, build = bench_of((FRICTION,), [term], lacks)
        run = best_numbers(replay, best, {term.key}, build, None)
        assert run.whole
        [found] = run.explanation.found
        if term is sure:
            assert found is term  # nothing was left to fit
        else:
            assert 0.0 < found.held["torque"] < 0.3  # 30 N are told to a hundredth by far
            assert abs(found.parameters["torque"] - 30.0) < 4 * found.held["torque"]


def test_nothing_completes_what_is_whole_or_what_no_law_completes() -> None:
    lacks = AXIS.model_copy(update={"effects": ()})
    assert completed_of((FRICTION,), [term_of(FRICTION)], lacks) is None
    assert completed_of((FRICTION, SPRING), [], lacks) is None
    pushes = [
        EffectUse(effect="external_torque", at="joint1", torque=40.0 * s, start=t, duration=0.3)
        for s, t in ((1, 4.0),)
    ]
    assert completed_of((FRICTION, *pushes), [term_of(FRICTION)], lacks) is None


def test_a_richer_law_takes_the_place_of_one_that_leaves_more_than_noise() -> None:
    law = {"coulomb_torque": 30.0, "static_torque": 50.0, "stribeck_velocity": 0.02}
    stribeck = EffectUse.model_validate({"effect": "stribeck_friction", "at": "joint1", **law})
    found = completed_of((stribeck,), [term_of(FRICTION)], AXIS.model_copy(update={"effects": ()}))
    assert found is not None
    [term] = found.found
    assert term.effect.id == "stribeck_friction"
    assert term.parameters["static_torque"] == pytest.approx(50.0, rel=0.02)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_richer_law_is_run_though_noise_makes_its_friction_at_rest_none(
    share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A regression with such numbers tells nothing of friction at rest, or that it is that of sliding."""

    def deaf(problem: Any, view: Any, current: Explanation, candidate: Any, **known: Any) -> Explanation:
        trial = refit(problem, view, current, candidate, **known)
        if candidate.term.effect.id != "stribeck_friction":
            return trial
        fresh = next(t for t in trial.terms if t.key == candidate.term.key)
        rest = share * fresh.parameters["coulomb_torque"]
        numbers = {**fresh.parameters, "static_torque": rest}
        flat = replace(fresh, parameters=numbers, unseen=("static_torque",))
        return replace(trial, terms=(*trial.terms_without(fresh), flat))

    monkeypatch.setattr(rescue, "refit", deaf)
    test_a_richer_law_takes_the_place_of_one_that_leaves_more_than_noise()


def test_a_richer_law_is_run_though_a_regression_is_far_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs with such numbers leave more than those of the plainer law, so that no fit goes on from them."""

    def misled(problem: Any, view: Any, current: Explanation, candidate: Any, **known: Any) -> Explanation:
        trial = refit(problem, view, current, candidate, **known)
        if candidate.term.effect.id != "stribeck_friction":
            return trial
        fresh = next(t for t in trial.terms if t.key == candidate.term.key)
        far = replace(
            fresh, parameters={**fresh.parameters, "static_torque": 500.0, "stribeck_velocity": 0.005}
        )
        return replace(trial, terms=(*trial.terms_without(fresh), far))

    monkeypatch.setattr(rescue, "refit", misled)
    test_a_richer_law_takes_the_place_of_one_that_leaves_more_than_noise()
