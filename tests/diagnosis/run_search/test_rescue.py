"""What runs in closed loop save of what a regression, or curves without a law, refused."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from end_to_end_cases import AXIS, FRICTION, QUICK, otherwise
from rescue_cases import SPRING, term_of

from missing_physics.diagnosis import Options, one_look
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.candidates.fitted import refit
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.search import Search
from missing_physics.diagnosis.preparation.proof import HeldOut
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments, nominal_terms
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.run_search import rescue
from missing_physics.diagnosis.run_search.rescue import proved, rescued
from missing_physics.diagnosis.runs import confirmation as closed_loop
from missing_physics.diagnosis.runs import energies as run_energies
from missing_physics.diagnosis.runs.confirmation import refused_in_runs
from missing_physics.diagnosis.runs.doubt import leftovers, moved_by_numbers, says_nothing
from missing_physics.diagnosis.runs.energies import left_in_runs
from missing_physics.diagnosis.runs.numbers import Run, allowed_in, plainer
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.unnamed.adequacy import adequate
from missing_physics.diagnosis.written.augment import with_inertial
from missing_physics.results.result import Rung
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate
from robot_model import EffectUse, JointPD, Recording, Robot, load_robot, robot_from_toml

pytestmark = pytest.mark.proof


def test_one_effect_that_was_refused_is_named_where_runs_need_nothing_else() -> None:
    lacks = AXIS.model_copy(update={"effects": ()})
    recordings = [simulate(r.with_effects(FRICTION), seed=16) for r in (lacks, otherwise(lacks))]
    tried = ("torque_ripple", "coulomb_friction")
    found = refused_and_run(lacks, recordings, tried)
    assert found is not None
    [term] = found.found
    assert term.effect.id == "coulomb_friction"
    # 30 N are told to a hundredth by far
    assert term.parameters["torque"] == pytest.approx(30.0, rel=0.01)
    assert refused_and_run(lacks, recordings, tried[:1]) is None
    assert refused_and_run(lacks, recordings, tried, run=False) is None


def test_the_regression_s_number_need_not_be_exact(monkeypatch: pytest.MonkeyPatch) -> None:
    """Off by a fifth it leaves many noise; runs with a better one leave the noise, and name the effect."""

    def off(*given: Any, **known: Any) -> Explanation:
        found = refit(*given, **known)
        terms = (replace(t, parameters={k: 0.8 * v for k, v in t.parameters.items()}) for t in found.terms)
        return replace(found, terms=tuple(terms))

    monkeypatch.setattr(rescue, "refit", off)
    lacks = AXIS.model_copy(update={"effects": ()})
    recordings = [simulate(r.with_effects(FRICTION), seed=16) for r in (lacks, otherwise(lacks))]
    found = refused_and_run(lacks, recordings, ("coulomb_friction",))
    assert found is not None
    [term] = found.found
    assert term.effect.id == "coulomb_friction"
    assert term.parameters["torque"] == pytest.approx(30.0, rel=0.01)
    assert refused_and_run(lacks, recordings, ("torque_ripple",)) is None


def test_what_the_robot_s_own_numbers_do_as_well_is_not_named() -> None:
    """With its friction estimated anew the robot needs nothing."""
    has = AXIS.model_copy(update={"effects": (FRICTION,)})
    more = FRICTION.model_copy(update={"torque": 45.0})
    changed = AXIS.model_copy(update={"effects": (more,)})
    recordings = [simulate(r, seed=17) for r in (changed, otherwise(changed))]
    assert refused_and_run(has, recordings, ("torque_ripple", "viscous_friction")) is None


def test_runs_prove_what_brings_every_recording_down_to_the_noise_and_nothing_else() -> None:
    lacks = AXIS.model_copy(update={"effects": ()})
    moved = lacks, otherwise(lacks)
    differing = [simulate(r.with_effects(FRICTION), seed=22 + k) for k, r in enumerate(moved)]
    alike = [simulate(r, seed=22 + k) for k, r in enumerate(moved)]
    segments = make_segments(lacks, differing)
    data = split(segments, 1, inertial_basis(lacks, segments[:1]), seed=0)
    start = explain(data.problem, data.view, [])
    exact = Term(get_effect("coulomb_friction"), "joint1", {"torque": FRICTION.parameters["torque"]})
    named = explain(data.problem, data.view, [exact])

    def build(explanation: Explanation, factor: float = 1.0) -> Robot:
        found = explanation.found
        return lacks.with_effects(FRICTION.model_copy(update={"torque": 30.0 * factor})) if found else lacks

    there, nothing = Replay.of(lacks, differing), Replay.of(lacks, alike)
    assert proved(there, start, named, build)
    assert not proved(None, start, named, build)
    assert not proved(there, start, start, build)
    assert not proved(there, start, named, lambda explanation: None)
    assert not proved(there, start, named, lambda explanation: build(explanation, 1.1))  # not the noise alone
    assert not proved(nothing, start, named, lambda explanation: build(explanation, 1e-9))  # nothing differs


def test_names_that_runs_prove_are_not_refused_by_curves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Curves that refuse every second name, here; one alone would be rescued."""
    hidden = FRICTION, EffectUse(effect="cable_spring", at="joint1", stiffness=60.0, torque_at_zero=0.0)
    recordings = [simulate(r.with_effects(*hidden), seed=26) for r in (AXIS, otherwise(AXIS))]

    def refusing(best: Explanation, held_out: HeldOut, **known: Any) -> Any:
        kept, accounts, _ = adequate(best, held_out, **known)
        less = explain(kept.problem, kept.view, kept.terms_without(kept.found[-1]), nuisance=False)
        return less, accounts, ((kept.found[-1], "refused here"),)

    monkeypatch.setattr(one_look, "adequate", refusing)
    found = diagnose(AXIS, recordings[:1], recordings[1:], options=QUICK).diagnosis
    assert {f"{f.effect}@{f.location}" for f in found.findings} == {
        "coulomb_friction@joint1",
        "cable_spring@joint1",
    }
    assert not any("refused here" in sentence for sentence in found.could_not_tell)


def test_names_with_which_the_robot_moves_otherwise_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs that leave a third, here of a fit whose number is off; with the right one they leave the noise."""
    lacks = AXIS.model_copy(update={"effects": ()})
    recordings = [
        simulate(r.with_effects(FRICTION), seed=41 + k) for k, r in enumerate((lacks, otherwise(lacks)))
    ]
    segments = make_segments(lacks, recordings)
    data = split(segments, 1, inertial_basis(lacks, segments[:1]), seed=0)
    best = explain(data.problem, data.view, [term_of(FRICTION)], nuisance=False)
    replay = Replay.of(lacks, recordings[:1], recordings[1:])

    def build(factor: float) -> Any:
        return lambda e: lacks.with_effects(FRICTION.model_copy(update={"torque": factor * 30.0}))

    assert refused_in_runs(replay, best, build(1.0)) == ""
    assert refused_in_runs(replay, best, build(1.1)) == ""  # leaves a hundredth of the energy
    assert "something else is there" in refused_in_runs(replay, best, build(1.6))
    assert refused_in_runs(None, best, build(1.6)) == ""
    nothing = explain(data.problem, data.view, [], nuisance=False)
    assert refused_in_runs(replay, nothing, build(1.6)) == ""

    monkeypatch.setattr(one_look, "refused_in_runs", lambda *given: "it is refused here")
    monkeypatch.setattr(one_look, "found_by_runs", lambda *given: None)  # it would name it again
    result = diagnose(lacks, recordings[:1], recordings[1:], options=QUICK)
    found = result.diagnosis
    assert (found.verdict, found.findings) == ("unexplained", ())
    assert "Coulomb friction at joint1 is not named: it is refused here." in found.could_not_tell
    # the file holds the standard model, which predicts better than nothing, and none of what was refused
    written = {use.effect for use in robot_from_toml(result.augmented_robot_toml).effects}
    assert written <= {"viscous_friction", "coulomb_friction", "torque_offset"}


def test_runs_that_move_with_a_number_as_far_as_they_are_off_refuse_nothing() -> None:
    """An offset of the torque's sensor moves its channel by itself, in units of the noise, and no other."""
    offset = EffectUse(effect="sensor_offset", at="joint1.torque", offset=2.0)
    lacks = AXIS.model_copy(update={"effects": ()})
    recordings = [simulate(r.with_effects(offset), seed=5) for r in (lacks, otherwise(lacks))]
    replay = Replay.of(lacks, recordings)
    assert replay is not None
    wrong = lacks.with_effects(offset.model_copy(update={"offset": 2.5}))
    moved = moved_by_numbers(replay, wrong, {("sensor_offset", "joint1.torque"): {"offset": 0.5}})
    sensor = lacks.sensor("joint1.torque")
    assert sensor is not None
    noise = np.hypot(sensor.noise, sensor.resolution / np.sqrt(12))
    for which, energy in enumerate(moved):
        by_name = dict(zip(replay.channels, energy))
        assert by_name.pop("joint1.torque") == pytest.approx((0.5 / noise) ** 2, rel=0.01)  # rounding
        assert not any(by_name.values())
        energies = replay.energies(wrong, which)
        assert energies is not None
        place = replay.channels.index("joint1.torque")
        assert says_nothing(energies, energy)[place]
        assert not says_nothing(energies, energy / 5)[place]


def test_what_a_law_leaves_of_a_channel_that_it_explains_is_reported() -> None:
    """Far beyond the noise in every recording, of a channel of which it explains most."""
    replay: Any = SimpleNamespace(robot=AXIS, channels=("joint1.position", "joint1.torque"), fitted=1)
    before = [np.array([5.0, 1001.0]), np.array([5.0, 2001.0])]

    def told(*torque: float, moved: float | None = None) -> list[tuple[str, float]]:
        runs = [np.array([1.0, energy]) for energy in torque]
        how_far = None if moved is None else [np.full(2, moved)] * 2
        return [(left.channel, left.part) for left in leftovers(replay, runs, before, how_far)]

    # the held-out recording counts, as numbers take something of the fitted one
    assert told(21.0, 81.0) == [("joint1.torque", pytest.approx(0.04))]
    assert (
        "4.0% of the squared error of joint1.torque, 81 times"
        in leftovers(replay, [np.array([1.0, 21.0]), np.array([1.0, 81.0])], before)[0].words
    )
    assert not told(9.0, 81.0)  # not far beyond the noise in one of them
    assert not told(600.0, 1500.0)  # it explains something else
    assert not told(21.0, 81.0, moved=20.0)  # its numbers may make as much
    assert told(21.0, 81.0, moved=1.0)
    replay.robot = load_robot("six_joint_space_arm")  # whose numbers runs do not tell
    assert not told(21.0, 81.0)


def test_what_comes_down_to_the_noise_supports_a_name_however_far_runs_move() -> None:
    replay: Any = SimpleNamespace()
    before, new = [np.array([100.0, 100.0])], [np.array([1.0, 50.0])]

    def left(*moved: float) -> float | None:
        return left_in_runs(replay, new, before, moved=[np.array(moved)])

    alone = left_in_runs(replay, [new[0][:1]], [before[0][:1]])
    assert left(0.0, 0.0) == left_in_runs(replay, new, before)
    assert left(9.0, 0.0) == left(0.0, 0.0)
    assert left(9.0, 100.0) == alone
    assert left_in_runs(replay, [new[0][1:]], [before[0][1:]], moved=[np.array([100.0])]) is None


@pytest.mark.proof
@pytest.mark.parametrize("doubted", [True, False])
def test_near_where_the_control_loop_swings_runs_say_nothing(
    doubted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drive's lag that nearly makes a stiff loop unstable: a thousandth of it decides how a run swings."""
    pd = AXIS.controller
    assert isinstance(pd, JointPD)
    stiff = pd.model_copy(update={"kp": 6 * float(pd.kp), "kd": 6**0.5 * float(pd.kd)})  # type: ignore[arg-type]
    robot = AXIS.model_copy(update={"controller": stiff})
    lag = EffectUse(effect="actuator_lag", at="joint1", time_constant=0.004)
    recordings = [simulate(r.with_effects(lag), seed=3 + k) for k, r in enumerate((robot, otherwise(robot)))]
    if not doubted:
        monkeypatch.setattr(run_energies, "says_nothing", lambda new, moved: np.zeros(len(new), dtype=bool))
    found = diagnose(robot, recordings[:1], recordings[1:], options=Options(experiments=False)).diagnosis
    if doubted:
        [finding] = found.findings
        assert found.verdict in ("explained", "partly_explained")
        assert (finding.effect, finding.location) == ("actuator_lag", "joint1")
        low, high = finding.parameters["time_constant"].ci95
        assert low <= 0.004 <= high
    else:
        assert (found.verdict, found.findings) == ("unexplained", ())


def refused_and_run(
    robot: Robot, recordings: list[Recording], tried: tuple[str, ...], *, run: bool = True
) -> Explanation | None:
    """What is rescued of a search that refused all that it `tried`."""
    segments = make_segments(robot, recordings)
    data = split(segments, 1, inertial_basis(robot, segments[:1]), seed=0)
    start = explain(data.problem, data.view, nominal_terms(robot))
    ladder = [Rung(name, "joint1", (), 1.0, 1.0, evidence=3.0, kept=False, why="evidence") for name in tried]

    def build(explanation: Explanation) -> Robot:
        uses = [EffectUse(effect=t.effect.id, at=t.at, **t.own) for t in explanation.terms]
        return robot.model_copy(update={"effects": tuple(uses)})

    replay = Replay.of(robot, recordings) if run else None
    return rescued(replay, Search(start, start, ladder=ladder), start, build, lambda phrase: None)


def test_names_that_went_come_back_with_better_numbers_where_runs_need_nothing_else() -> None:
    """Two names, refused together; the regression tried nothing else."""
    lacks = AXIS.model_copy(update={"effects": ()})
    moved = lacks, otherwise(lacks)
    recordings = [simulate(r.with_effects(FRICTION, SPRING), seed=41 + k) for k, r in enumerate(moved)]
    segments = make_segments(lacks, recordings)
    data = split(segments, 1, inertial_basis(lacks, segments[:1]), seed=0)
    start = explain(data.problem, data.view, [])
    both = replace(start, terms=(term_of(FRICTION, 0.9), term_of(SPRING, 1.1)))

    def build(explanation: Explanation) -> Robot:
        return lacks.with_effects(
            *(EffectUse(effect=t.effect.id, at=t.at, **t.own) for t in explanation.terms)
        )

    replay, search = Replay.of(lacks, recordings[:1], recordings[1:]), Search(start, start)
    assert rescued(replay, search, start, build, lambda phrase: None) is None
    found = rescued(replay, search, both, build, lambda phrase: None)
    assert found is not None
    named = {t.key: t.parameters for t in found.found}
    # told to a hundredth by far
    assert named["coulomb_friction", "joint1"]["torque"] == pytest.approx(30.0, rel=0.01)
    assert named["cable_spring", "joint1"]["stiffness"] == pytest.approx(600.0, rel=0.01)


@pytest.mark.parametrize(("left", "named"), [(0.03, 1), (0.06, 0)])
def test_the_only_name_comes_back_where_next_to_nothing_is_left_with_it(
    left: float, named: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside a robot that was tuned runs leave more than noise."""
    lacks = AXIS.model_copy(update={"effects": ()})
    recordings = [simulate(r.with_effects(FRICTION), seed=46) for r in (lacks, otherwise(lacks))]
    segments = make_segments(lacks, recordings)
    data = split(segments, 1, inertial_basis(lacks, segments[:1]), seed=0)
    start = explain(data.problem, data.view, [])
    one = replace(start, terms=(term_of(FRICTION),))
    two = replace(start, terms=(term_of(FRICTION), term_of(SPRING)))
    loud, quiet = [np.full(2, 4.0), np.full(2, 4.0)], [np.full(2, 1.1), np.full(2, 1.1)]
    monkeypatch.setattr(rescue, "best_numbers", lambda _, trial, *__, **___: Run(trial, loud, left, quiet))
    monkeypatch.setattr(rescue, "completed", lambda *_: None)
    replay, search = Replay.of(lacks, recordings[:1], recordings[1:]), Search(start, start)
    found = rescued(replay, search, one, lambda explanation: lacks, lambda phrase: None)
    assert (0 if found is None else len(found.found)) == named
    assert rescued(replay, search, two, lambda explanation: lacks, lambda phrase: None) is None


def test_of_held_out_recordings_next_to_nothing_of_what_differed_may_be_left() -> None:
    """Where a wall stands is known as well as the fitted recording tells, and a run may lean on it longer."""
    lacks = AXIS.model_copy(update={"effects": ()})
    recordings = [simulate(r, seed=47) for r in (lacks, otherwise(lacks))]
    replay = Replay.of(lacks, recordings[:1], recordings[1:])
    assert replay is not None
    few, many = (np.full(len(replay.channels), e) for e in (1.02, 2001.0))
    explanation = Explanation.__new__(Explanation)

    def quiet(fitted: float, held_out: float, before: list[np.ndarray]) -> bool:
        energies = [np.full(len(replay.channels), e) for e in (fitted, held_out)]
        return Run(explanation, energies, 0.01, allowed_in(replay, before)).quiet

    assert quiet(1.05, 1.05, [few, few])
    assert quiet(1.05, 2.9, [many, many])
    assert not quiet(1.05, 3.1, [many, many])
    assert not quiet(1.2, 1.05, [many, many])  # the fitted one has no excuse
    assert not quiet(1.05, 1.2, [many, few])


@pytest.mark.parametrize("heavier", [1.0, 1.2])
def test_the_robot_file_s_numbers_stay_where_runs_come_nearer_with_them(heavier: float) -> None:
    """A fifth more mass in a regression is wrong of a robot as described, and right of a heavier one."""
    lacks = AXIS.model_copy(update={"effects": ()})
    real = lacks.model_copy(
        update={"links": tuple(k.model_copy(update={"mass": heavier * k.mass}) for k in lacks.links)}
    )
    moved = real, otherwise(real)
    recordings = [simulate(r.with_effects(FRICTION), seed=51 + k) for k, r in enumerate(moved)]
    segments = make_segments(lacks, recordings)
    basis = inertial_basis(lacks, segments[:1])
    data = split(segments, 1, basis, seed=0)
    named = explain(data.problem, data.view, [term_of(FRICTION)])
    mass = basis.names.index("carriage.mass")
    more = 0.2 * lacks.links[0].mass
    off = replace(named, nuisance=np.linalg.lstsq(basis.directions[[mass]], [more], rcond=None)[0])

    def build(explanation: Explanation) -> Robot:
        uses = [EffectUse(effect=t.effect.id, at=t.at, **t.own) for t in explanation.terms]
        changed = lacks.with_effects(*uses)
        if not explanation.nuisance.size:
            return changed
        found, remark = with_inertial(changed, basis.names, basis.directions @ explanation.nuisance)
        assert not remark
        return found

    replay = Replay.of(lacks, recordings[:1], recordings[1:])
    assert plainer(None, off, build) is off
    assert (plainer(replay, off, build) is off) == (heavier > 1.0)
    assert plainer(replay, off, build).found


@pytest.mark.parametrize(("factor", "refused"), [(1.5, False), (60.0, True)])
def test_what_is_many_times_as_far_off_is_refused_however_far_numbers_move_it(
    factor: float, refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    lacks = AXIS.model_copy(update={"effects": ()})
    moved = lacks, otherwise(lacks)
    recordings = [simulate(r.with_effects(FRICTION), seed=61 + k) for k, r in enumerate(moved)]
    segments = make_segments(lacks, recordings)
    data = split(segments, 1, inertial_basis(lacks, segments[:1]), seed=0)
    named = explain(data.problem, data.view, [term_of(FRICTION)], nuisance=False)
    named = replace(named, terms=(term_of(FRICTION, factor),))

    def build(explanation: Explanation) -> Robot:
        return lacks.with_effects(
            *(EffectUse(effect=t.effect.id, at=t.at, **t.own) for t in explanation.terms)
        )

    def far(replay: Replay, *_: Any) -> list[Any]:
        return [np.full(len(replay.channels), np.inf) for _ in replay.asked]

    monkeypatch.setattr(closed_loop, "moved_by_numbers", far)
    replay = Replay.of(lacks, recordings[:1], recordings[1:])
    assert bool(refused_in_runs(replay, named, build)) is refused


@pytest.mark.proof
def test_a_name_to_which_runs_give_no_size_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its number is asked again after runs have told it."""

    def told(replay: object, best: Explanation, build: object) -> Explanation:
        springs = [t for t in best.found if t.effect.id == "cable_spring"]
        for spring in springs:
            none = replace(spring, parameters=dict.fromkeys(spring.parameters, 0.0), unseen=())
            held = replace(none, held=dict.fromkeys(none.free, 1.0))
            terms = [held if t.key == spring.key else t for t in best.terms]
            best = explain(best.problem, best.view, terms, nuisance=False)
        return best

    lacks = AXIS.model_copy(update={"effects": ()})
    recordings = [simulate(r.with_effects(FRICTION, SPRING), seed=5) for r in (lacks, otherwise(lacks))]

    def names() -> set[str]:
        found = diagnose(lacks, recordings[:1], recordings[1:], options=Options(experiments=False))
        return {f.effect for f in found.diagnosis.findings}

    assert names() == {"coulomb_friction", "cable_spring"}
    monkeypatch.setattr(one_look, "surest", told)
    assert "cable_spring" not in names()
