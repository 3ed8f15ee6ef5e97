"""Effects that runs alone find, where torques along the motion tell of nothing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from end_to_end_cases import AXIS, FRICTION, QUICK, otherwise, within
from rescue_cases import SPRING, deafened, term_of

from missing_physics.diagnosis import Diagnosis
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.preparation.setup import (
    InertialBasis,
    inertial_basis,
    make_segments,
    nominal_terms,
)
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.run_search import search as run_search
from missing_physics.diagnosis.run_search.trials import _with_amplitudes
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.written.augment import augmented_robot, with_masses
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot

LACKS = AXIS.model_copy(update={"effects": ()})


def told(*hidden: EffectUse, held_out: bool = True, file: Robot = LACKS) -> Diagnosis:
    real = LACKS.with_effects(*hidden)
    recordings = [simulate(r, seed=k) for k, r in enumerate((real, otherwise(real)))]
    validation = recordings[1:] if held_out else []
    return diagnose(file, recordings[:1], validation, options=QUICK).diagnosis


@pytest.fixture(autouse=True)
def _deafened(monkeypatch: pytest.MonkeyPatch) -> None:
    deafened(monkeypatch)


@pytest.mark.proof
def test_an_effect_is_found_with_its_number() -> None:
    found = told(SPRING)
    assert found.verdict == "explained"
    [finding] = found.findings
    assert (finding.effect, finding.location) == ("cable_spring", "joint1")
    # runs tell 600 N/m to a thousandth and better
    assert finding.parameters["stiffness"].value == pytest.approx(600.0, rel=1e-3)
    low, high = finding.parameters["stiffness"].ci95
    assert low < 600.0 < high
    assert {item.location for item in found.mismatch} == {"joint1"}


@pytest.mark.proof
def test_numbers_that_hide_it_in_the_fitted_recording_are_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Masses moved by a regression may do there what is missing; here a spring that the file lacks does."""

    def hiding(replay: object, start: Explanation, build: object) -> Explanation:
        spring = replace(term_of(SPRING), nominal=True, frozen=True)
        return explain(start.problem, start.view, [*start.terms, spring], nuisance=False)

    monkeypatch.setattr(run_search, "plainer", hiding)
    [finding] = told(SPRING).findings
    assert (finding.effect, finding.location) == ("cable_spring", "joint1")


@pytest.mark.proof
def test_numbers_of_the_file_that_were_tuned_without_it_come_back_with_it() -> None:
    """A carriage half a kilogram too light, and friction that the robot has not, hide part of a spring."""
    [carriage] = LACKS.links
    tuned = LACKS.model_copy(
        update={"links": (carriage.model_copy(update={"mass": carriage.mass - 0.5}),)}
    ).with_effects(EffectUse(effect="viscous_friction", at="joint1", coefficient=3.0))
    found = told(SPRING, file=tuned)
    [finding] = found.findings
    assert (finding.effect, finding.location) == ("cable_spring", "joint1")
    assert within(finding.parameters["stiffness"], 600.0)
    assert finding.parameters["stiffness"].value == pytest.approx(600.0, rel=5e-3)  # within its interval
    own = {change.name: change for change in found.nominal_parameters}
    assert own["viscous_friction@joint1.coefficient"].estimate == pytest.approx(0.0, abs=0.1)
    moved = sum(c.estimate - c.nominal for name, c in own.items() if name.endswith(("mass", "inertia")))
    assert moved == pytest.approx(0.5, abs=0.02)


@pytest.mark.proof
def test_where_two_are_missing_both_are_found() -> None:
    """One alone leaves more than noise, whatever its numbers."""
    found = told(SPRING, FRICTION)
    assert found.verdict == "explained"
    named = {f.effect: f for f in found.findings}
    assert set(named) == {"cable_spring", "coulomb_friction"}
    # runs tell 600 N/m and 30 N to a thousandth and better
    assert named["cable_spring"].parameters["stiffness"].value == pytest.approx(600.0, rel=1e-3)
    assert named["coulomb_friction"].parameters["torque"].value == pytest.approx(30.0, rel=1e-3)


def test_nothing_is_found_where_no_recording_was_held_out() -> None:
    assert not told(SPRING, held_out=False).findings


def test_nothing_is_found_where_nothing_is_missing() -> None:
    found = told()
    assert found.verdict == "consistent"
    assert not found.findings


@pytest.mark.proof
def test_two_that_each_do_a_part_are_found_together() -> None:
    """An encoder's zero, which no torque tells where nothing pulls, and a torque sensor's gain."""
    zero = EffectUse(effect="sensor_offset", at="joint1.position", offset=2e-3)
    gain = EffectUse(effect="sensor_gain", at="joint1.torque", gain_error=-0.06)
    found = told(zero, gain)
    named = {(f.effect, f.location): f for f in found.findings}
    assert set(named) == {("sensor_offset", "joint1.position"), ("sensor_gain", "joint1.torque")}
    # both stand out of the noise by far more than a hundredth
    assert named["sensor_offset", "joint1.position"].parameters["offset"].value == pytest.approx(
        2e-3, rel=0.01
    )
    assert named["sensor_gain", "joint1.torque"].parameters["gain_error"].value == pytest.approx(
        -0.06, rel=0.01
    )


@pytest.mark.parametrize(
    ("names", "loud", "found", "order"),
    [
        (0, 100.0, {}, ["nothing"]),
        (1, 100.0, {"best"}, ["best"]),
        (1, 100.0, {}, ["best", "nothing"]),
        (1, 5.0, {}, ["best"]),  # as near as numbers may leave it
        (2, 5.0, {"nothing"}, ["nothing"]),
        (2, 5.0, {}, ["nothing", "best"]),
        (2, 1.0, {}, ["best"]),  # down to the noise
    ],
)
def test_where_names_are_not_enough_one_effect_is_looked_for_in_their_place(
    monkeypatch: pytest.MonkeyPatch, names: int, loud: float, found: set[str], order: list[str]
) -> None:
    started: list[str] = []

    def from_start(replay: object, start: SimpleNamespace, *given: object, **most: object) -> str | None:
        started.append(start.label)
        return start.label if start.label in found else None

    monkeypatch.setattr(run_search, "_found_from", from_start)
    monkeypatch.setattr(run_search, "runs_of", lambda *given: [np.array([loud])] * 2)
    monkeypatch.setattr(run_search, "loudest", lambda *given: loud)
    replay = cast(Replay, SimpleNamespace(robot=LACKS, doubt=lambda which: 0.0))
    nothing = SimpleNamespace(label="nothing", found=())
    best = SimpleNamespace(label="best", found=(term_of(SPRING),) * names) if names else nothing
    basis = cast(InertialBasis, None)
    given = cast(Explanation, best), cast(Explanation, nothing), basis
    run_search.found_by_runs(replay, *given, lambda e: LACKS, lambda phrase: None)
    assert started == order


@pytest.mark.proof
def test_tuned_masses_beside_a_name_are_no_effect_more() -> None:
    """A carriage five kilograms too light, and friction that is not there, beside a spring that is named."""
    [carriage] = LACKS.links
    lighter = carriage.model_copy(update={"mass": carriage.mass - 5.0})
    file = LACKS.model_copy(update={"links": (lighter,)}).with_effects(
        EffectUse(effect="viscous_friction", at="joint1", coefficient=30.0)
    )
    real = LACKS.with_effects(SPRING)
    recordings = [simulate(r, seed=k) for k, r in enumerate((real, otherwise(real)))]
    segments = make_segments(file, recordings)
    basis = inertial_basis(file, segments[:1])
    data = split(segments, 1, basis, seed=0)
    terms = [replace(term, frozen=True) for term in nominal_terms(file)]
    nothing = explain(data.problem, data.view, terms, nuisance=False)
    best = explain(data.problem, data.view, [*terms, term_of(SPRING)], nuisance=False)
    replay = Replay.of(file, recordings[:1], recordings[1:])

    def build(explanation: Explanation) -> Robot | None:
        changed, remark = with_masses(augmented_robot(file, explanation.terms), basis, explanation)
        return None if remark else changed

    found = run_search.found_by_runs(replay, best, nothing, basis, build, lambda phrase: None)
    assert found is not None
    assert [t.key for t in found.explanation.found] == [("cable_spring", "joint1")]
    assert found.explanation.view.told is not None
    moved = float(basis.first(1)[0] @ found.explanation.view.told.values)
    assert moved == pytest.approx(5.0, rel=0.02)
    [friction] = [t for t in found.explanation.terms if t.nominal]
    assert friction.parameters["coefficient"] == pytest.approx(0.0, abs=0.3)


def test_a_joint_effect_has_all_its_amplitudes_in_runs() -> None:
    spring = Term(get_effect("cable_spring"), "joint1", {"stiffness": 1.0, "torque_at_zero": 0.0})
    bare = replace(spring, unseen=("torque_at_zero",))
    assert _with_amplitudes(bare).free == ("stiffness", "torque_at_zero")
    stop = Term(get_effect("inertia"), "link1", {}, unseen=("mass",))
    assert _with_amplitudes(stop).unseen == ("mass",)  # of a body runs see no more than torques do


MODES = get_effect("link_flexibility").parameters[:2]  # two numbers that stand for how modes began


@pytest.mark.parametrize(
    ("runs", "unreal", "beaten"),
    [(5, False, True), (run_search.MOST_FITTED, False, False), (5, True, True)],
    ids=["arrived", "cut off by want of runs", "no real body"],
)
def test_what_a_search_makes_of_its_fits(
    monkeypatch: pytest.MonkeyPatch, runs: int, *, unreal: bool, beaten: bool
) -> None:
    """Refused is what arrived and is not enough, and what cannot be; numbers count that runs have."""
    first = Term(get_effect("viscous_friction"), "joint1", {"coefficient": 1.0})
    second = Term(get_effect("coulomb_friction"), "joint1", {"torque": 1.0})
    second = replace(second, parameters={**second.parameters, **{m.name: 0.0 for m in MODES}}, beside=MODES)
    replay = SimpleNamespace(made=0, robot=LACKS, asked=(), fitted=1)

    def refined(_: object, trial: Term, *__: object, **___: object) -> SimpleNamespace:
        replay.made += runs if trial is first else 5
        return SimpleNamespace(found=(trial,), terms=(trial,), problem=None)

    bench = run_search._Bench(replay, SimpleNamespace(found=()), None, None, lambda e: e, lambda _: None)  # type: ignore[arg-type]
    quiet = [np.array([1.0])]
    loud = quiet if unreal else [np.array([5.0])]
    costs: list[int] = []
    monkeypatch.setattr(run_search, "refined", refined)
    monkeypatch.setattr(
        run_search, "runs_of", lambda _, e: loud if first in getattr(e, "found", ()) else quiet
    )
    monkeypatch.setattr(run_search, "left_in_runs", lambda *_: 0.0)
    monkeypatch.setattr(run_search, "allowed_in", lambda *_: [np.array([1.3])])
    monkeypatch.setattr(run_search, "unreal", lambda _, term: unreal and term is first)
    monkeypatch.setattr(run_search, "incredible", lambda *_: "")
    monkeypatch.setattr(run_search, "_cost", lambda *given: costs.append(given[-1]) or 0.0)
    looks = [SimpleNamespace(left=0.0, beside=0.0, trial=term, term=term) for term in (first, second)]
    found = bench.fitted(looks, ())  # type: ignore[arg-type]
    assert found is not None
    assert found.name == second.key
    assert (first.key in found.beaten) == beaten
    assert costs == [1]  # of Coulomb friction's torque, and not of how modes began
