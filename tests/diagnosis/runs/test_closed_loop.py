"""What runs in closed loop say of names and of their rivals."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from end_to_end_cases import ARM, AXIS, FRICTION, QUICK, otherwise

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.candidates.effects import candidates, first_look
from missing_physics.diagnosis.candidates.fitted import refit
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.judge import Weighed, weigh
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments, nominal_terms
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.confirmation import (
    LEAST,
    REGRESSION,
    _hinders,
    _settled,
    arbitrated,
    confirmed,
)
from missing_physics.diagnosis.runs.energies import evidence_for, told_apart
from missing_physics.diagnosis.runs.rivals import rivals
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.written.words import NO_RUN_NEEDS
from missing_physics.results.result import Diagnosis, Finding, Fit, Result
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate
from robot_model import (
    EffectUse,
    JointPD,
    Recording,
    Robot,
    robot_to_toml,
)

ONLY_NAMED = Options(experiments=False, simulation=False)


def test_recordings_that_disagree_say_nothing() -> None:
    good, bad = np.array([1.0, 1.0]), np.array([1.0, 9.0])
    assert evidence_for([bad, bad], [good, good]) > 5
    assert evidence_for([good, good], [bad, bad]) < -5
    assert evidence_for([bad, good], [good, bad]) == 0.0
    # of recordings in which both leave the noise nothing is heard
    assert evidence_for([bad, good], [good, good]) == evidence_for([bad], [good]) > 2
    assert evidence_for([good, good], [good, good]) == 0.0
    # where one does all recordings, another that does one of them nearly as well is heard in each
    near, far = np.array([1.0, 1.6]), np.array([1.0, 90.0])
    apart = evidence_for([good, good], [near, far])
    assert apart == pytest.approx(evidence_for([good], [near]) + evidence_for([good], [far]))
    assert evidence_for([near, far], [good, good]) == pytest.approx(-apart)
    assert evidence_for([bad, bad], [near, far]) == 0.0
    # what both leave next to noise is no evidence to speak of
    assert abs(evidence_for([np.array([1.04])] * 2, [np.array([1.0])] * 2)) < 1


def test_a_rival_takes_the_place_only_where_it_is_clearly_likelier() -> None:
    term, rival = (Term(get_effect(e), "joint1", {}) for e in ("torque_gain", "actuator_lag"))
    item = Weighed(term, 0.8, ((rival, 0.15),))
    best, other = Explanation.__new__(Explanation), Explanation.__new__(Explanation)
    kept, chosen = _settled(item, best, [(rival, 0.5, other)])
    assert chosen is best
    assert kept.term is term
    swapped, chosen = _settled(item, best, [(rival, 4.0, other)])
    assert chosen is other
    assert swapped.term is rival
    assert swapped.probability == pytest.approx(0.95 / (1 + np.exp(-4.0)))
    assert [t for t, _ in swapped.alternatives] == [term]
    assert _settled(item, best, []) == (item, best)


def test_a_regression_outweighs_runs_no_more_than_its_share() -> None:
    """Of a name that runs alone have proven, whose rivals fit better along the motion."""
    term, heard, unheard = (
        Term(get_effect(e), "joint1", {}) for e in ("torque_gain", "actuator_lag", "inertia")
    )
    item = Weighed(term, 1e-40, ((heard, 0.5), (unheard, 0.5)))
    best, other = Explanation.__new__(Explanation), Explanation.__new__(Explanation)
    kept, chosen = _settled(item, best, [(heard, REGRESSION - 20.0, other)])
    assert chosen is best
    chances = {kept.term.effect.id: kept.probability} | {t.effect.id: p for t, p in kept.alternatives}
    assert chances["actuator_lag"] / chances["torque_gain"] == pytest.approx(np.exp(REGRESSION - 20.0))
    assert chances["inertia"] / chances["torque_gain"] == pytest.approx(np.exp(REGRESSION))


def test_what_took_another_finding_s_place_is_no_rival_any_more() -> None:
    """It would stand there twice, each with a part of what it is."""
    lacks = AXIS.model_copy(update={"effects": ()})
    segments = make_segments(lacks, [simulate(lacks.with_effects(FRICTION), seed=19)])
    data = split(segments, 1, inertial_basis(lacks, segments), seed=0)
    spring, coulomb = (
        Term(get_effect(e), "joint1", dict.fromkeys(names, 1.0))
        for e, names in (("cable_spring", ("stiffness", "torque_at_zero")), ("coulomb_friction", ("torque",)))
    )
    viscous = Term(get_effect("viscous_friction"), "joint1", {"coefficient": 1.0})
    best = explain(data.problem, data.view, [spring, coulomb], nuisance=False)
    item = Weighed(best.found[1], 0.4, ((spring, 0.3), (viscous, 0.3)))
    found = list(rivals(best, item, None, [np.ones(1)], nuisance=False))
    assert [key for key, _, _ in found] == [viscous.key]
    assert {t.key for t in found[0][2].terms} == {spring.key, viscous.key}


@pytest.mark.parametrize(("there", "sure"), [(True, True), (False, False)])
def test_what_a_regression_is_unsure_of_runs_may_show_to_be_there(there: bool, sure: bool) -> None:
    lacks = AXIS.model_copy(update={"effects": ()})
    hidden = (FRICTION,) if there else ()
    recordings = [simulate(r.with_effects(*hidden), seed=19) for r in (lacks, otherwise(lacks))]
    segments = make_segments(lacks, recordings)
    data = split(segments, 1, inertial_basis(lacks, segments[:1]), seed=0)
    torque = 30.0 if there else 0.01
    term = Term(get_effect("coulomb_friction"), "joint1", {"torque": torque}, held={"torque": 1.0})
    best = explain(data.problem, data.view, [term], nuisance=False)

    def build(explanation: Explanation) -> Robot:
        return lacks.with_effects(
            *([FRICTION.model_copy(update={"torque": torque})] if explanation.found else [])
        )

    replay = Replay.of(lacks, recordings[:1], recordings[1:])
    _, [item], _ = arbitrated(
        replay, best, [Weighed(term, 0.3, ())], build, nuisance=False, progress=lambda phrase: None
    )
    assert item.probability == (pytest.approx(1.0, abs=1e-3) if sure else 0.3)


@pytest.mark.parametrize(
    ("impossible", "probability"),
    [("no robot", 1e-4), ("no robot", 1e-40), ("no run", 1e-4), ("no run", 1e-40)],
)
def test_what_cannot_be_is_no_rival_however_likely_a_regression_calls_it(
    impossible: str, probability: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As masses with which a link would be no body, or no simulation goes on: hardly a probability.

    Nor where a regression is as good as sure, and another rival moves the robot as what is named does.
    """
    lacks = AXIS.model_copy(update={"effects": ()})
    recordings = [simulate(r.with_effects(FRICTION), seed=19) for r in (lacks, otherwise(lacks))]
    segments = make_segments(lacks, recordings)
    data = split(segments, 1, inertial_basis(lacks, segments[:1]), seed=0)
    term = Term(get_effect("coulomb_friction"), "joint1", {"torque": FRICTION.parameters["torque"]})
    viscous = Term(get_effect("viscous_friction"), "joint1", {"coefficient": 1.0})
    offset = Term(get_effect("torque_offset"), "joint1", {"torque": 1.0})
    best = explain(data.problem, data.view, [term], nuisance=False)
    runaway = EffectUse.model_validate({"effect": "viscous_friction", "at": "joint1", "coefficient": 1e5})

    def build(explanation: Explanation) -> Robot | None:
        names = {t.effect.id for t in explanation.found}
        if "viscous_friction" in names:
            return None if impossible == "no robot" else lacks.with_effects(runaway)
        return lacks.with_effects(*([FRICTION] if names else []))

    replay = Replay.of(lacks, recordings[:1], recordings[1:])
    run = Replay._run

    def given_up(self: Replay, robot: Robot, *asked: Any) -> dict[str, np.ndarray] | None:
        return None if runaway in robot.effects else run(self, robot, *asked)

    monkeypatch.setattr(Replay, "_run", given_up)
    weighed = Weighed(term, probability, ((viscous, 0.96), (offset, probability * 1e-3)))
    _, [item], _ = arbitrated(replay, best, [weighed], build, nuisance=False, progress=print)
    assert item.term.effect.id == "coulomb_friction"
    assert item.probability > 0.9
    assert all(p < 1e-2 for _, p in item.alternatives)
    assert "viscous_friction" in {t.effect.id for t, _ in item.alternatives}


def test_what_runs_have_proven_keeps_its_place_and_gets_its_own_rivals() -> None:
    """Viscous friction stated where Coulomb's is there: the regression alone would exchange it."""
    lacks = AXIS.model_copy(update={"effects": ()})
    recordings = [simulate(r.with_effects(FRICTION), seed=18) for r in (lacks, otherwise(lacks))]
    segments = make_segments(lacks, recordings)
    data = split(segments, 1, inertial_basis(lacks, segments[:1]), seed=0)
    viscous = Term(get_effect("viscous_friction"), "joint1", {"coefficient": 1.0})
    stated = explain(data.problem, data.view, [viscous])

    def told(exchange: bool) -> tuple[Explanation, Weighed]:
        best, [item] = weigh(
            data.problem, data.view, stated, nuisance=True, progress=lambda phrase: None, exchange=exchange
        )
        assert [t.key for t in best.found] == [item.term.key]
        return best, item

    swapped, item = told(exchange=True)
    assert swapped is not stated
    assert item.term.effect.id != "viscous_friction"
    kept, item = told(exchange=False)
    assert kept is stated
    assert item.term.effect.id == "viscous_friction"
    assert "coulomb_friction" in {t.effect.id for t, p in item.alternatives if p > item.probability}


@pytest.mark.proof
@pytest.mark.parametrize(
    ("hidden", "rival"),
    [
        (EffectUse(effect="torque_gain", at="joint1", gain_error=-0.04), "sensor_gain@joint1.torque"),
        (EffectUse(effect="sensor_gain", at="joint1.torque", gain_error=0.04), "torque_gain@joint1"),
    ],
    ids=lambda value: getattr(value, "effect", ""),
)
def test_the_drive_s_gain_is_distinguished_from_its_sensor_s(hidden: EffectUse, rival: str) -> None:
    recording = simulate(ARM.with_effects(hidden), seed=13)
    assert rival.split("@")[0] in str(labels(recording, ONLY_NAMED))
    assert labels(recording, QUICK) == {f"{hidden.effect}@{hidden.at}": True}


def labels(recording: Recording, options: Options) -> dict[str, bool]:
    """What is named, its equals included, and whether it stands alone."""
    found = diagnose(ARM, [recording], options=options).diagnosis
    told = {f"{f.effect}@{f.location}": not f.ambiguous_with for f in found.findings}
    return told | {name: False for f in found.findings for name in f.ambiguous_with}


@pytest.mark.proof
@pytest.mark.parametrize(
    "hidden",
    [
        EffectUse(effect="sensor_delay", at="joint1.position", delay=5e-3),
        EffectUse(effect="actuator_lag", at="joint1", time_constant=5e-3),
    ],
    ids=lambda use: use.effect,
)
def test_a_late_encoder_is_distinguished_from_a_lagging_drive(hidden: EffectUse) -> None:
    """To first order both shift the torque against the motion alike."""
    found = diagnose(AXIS, [simulate(AXIS.with_effects(hidden), seed=14)], options=QUICK).diagnosis
    [finding] = found.findings
    assert (finding.effect, finding.location) == (hidden.effect, hidden.at)
    assert finding.ambiguous_with == ()


def test_a_name_with_which_the_robot_would_move_otherwise_is_not_believed() -> None:
    recording = simulate(AXIS, seed=15)
    replay = Replay.of(AXIS, [recording])
    named = Finding("coulomb_friction", "joint1", 0.97, {})
    told = Diagnosis("axis", ("one",), (), "explained", "", (), (named,), Fit({}, 0.9))
    result = Result(told, (), (), robot_to_toml(AXIS.with_effects(FRICTION)))
    found = confirmed(result, AXIS, replay).diagnosis
    assert found.verdict == "unexplained"
    assert found.findings[0].probability == pytest.approx(LEAST)
    assert any("in closed loop" in sentence for sentence in found.could_not_tell)
    assert confirmed(result, AXIS, None) is result


def test_what_was_found_between_encoders_is_held_against_the_robot_without_it() -> None:
    """Torques are explained, and their rivals run, with the gear in place; its number is never exact."""
    play = EffectUse(effect="backlash", at="joint1", half_width=2e-3, stiffness=1e6, damping=1e3)
    recording = simulate(ARM.with_effects(play), seed=15)
    written = ARM.with_effects(play.model_copy(update={"half_width": 1.9e-3}))
    replay = Replay.of(written, [recording])
    named = Finding("backlash", "joint1", 0.97, {})
    told = Diagnosis("arm", ("one",), (), "explained", "", (), (named,), Fit({}, 0.9))
    found = confirmed(Result(told, (), (), robot_to_toml(written)), ARM, replay).diagnosis
    assert found.verdict == "explained"
    assert found.findings[0].probability == pytest.approx(0.97, abs=0.01)


@pytest.mark.proof
@pytest.mark.parametrize("what", ["gains", "torque"])
def test_runs_say_nothing_where_another_controller_was_in_force(what: str) -> None:
    """A softer loop; or friction in the recorded torque that nothing commanded."""
    assert isinstance(AXIS.controller, JointPD)
    other = AXIS.controller.model_copy(update={"kp": 0.3 * float(np.ravel(AXIS.controller.kp)[0])})
    if what == "gains":
        recording = simulate(AXIS.with_effects(FRICTION).model_copy(update={"controller": other}), seed=15)
    else:
        recording = simulate(AXIS, seed=15)
        position = recording["joint1.position"]
        smooth = np.convolve(np.pad(position, 10, mode="edge"), np.ones(21) / 21, mode="valid")
        added = 30.0 * np.tanh(np.gradient(smooth, recording.time) / 1e-3)
        recording = recording.with_channels({"joint1.torque": recording["joint1.torque"] + added})
    found = diagnose(AXIS, [recording], options=QUICK).diagnosis
    assert [f.effect for f in found.findings] == ["coulomb_friction"]
    assert found.findings[0].probability > 0.9
    assert any("another controller was in force" in sentence for sentence in found.could_not_tell)


@pytest.mark.parametrize(
    "hidden",
    [
        EffectUse(
            effect="stribeck_friction",
            at="joint1",
            coulomb_torque=30.0,
            static_torque=50.0,
            stribeck_velocity=0.03,
        ),
        FRICTION,
    ],
    ids=lambda use: use.effect,
)
def test_a_richer_law_of_friction_is_run_where_the_simpler_one_leaves_more_than_noise(
    hidden: EffectUse,
) -> None:
    """Coulomb friction stated without rivals."""
    lacks = AXIS.model_copy(update={"effects": ()})
    recordings = [simulate(r.with_effects(hidden), seed=23) for r in (lacks, otherwise(lacks))]
    segments = make_segments(lacks, recordings)
    data = split(segments, 1, inertial_basis(lacks, segments[:1]), seed=0)
    coulomb = Term(get_effect("coulomb_friction"), "joint1", {"torque": 30.0})
    stated = explain(data.problem, data.view, [coulomb], nuisance=False)

    def build(explanation: Explanation) -> Robot:
        uses = (EffectUse(effect=t.effect.id, at=t.at, **t.own) for t in explanation.terms)
        return lacks.model_copy(update={"effects": tuple(uses)})

    replay = Replay.of(lacks, recordings)
    weighed = [Weighed(stated.found[0], 0.98, ())]
    best, [item], _ = arbitrated(replay, stated, weighed, build, nuisance=False, progress=lambda phrase: None)
    assert [t.effect.id for t in best.found] == [hidden.effect]
    assert item.term.effect.id == hidden.effect
    assert item.probability > 0.9


def test_a_name_that_no_run_needs_goes_and_one_that_runs_need_stays() -> None:
    lacks = AXIS.model_copy(update={"effects": ()})
    moved = lacks, otherwise(lacks)
    # of ten pairs of seeds one stands out of the noise by chance
    recordings = [simulate(r.with_effects(FRICTION), seed=22 + k) for k, r in enumerate(moved)]
    segments = make_segments(lacks, recordings)
    data = split(segments, 1, inertial_basis(lacks, segments[:1]), seed=0)
    best = explain(data.problem, data.view, nominal_terms(lacks))
    for name in ("coulomb_friction", "torque_ripple"):
        looks = [c for c in candidates(data.problem, best) if c.term.effect.id == name]
        [first, *_] = first_look(data.problem, data.view, best, looks)
        best = refit(data.problem, data.view, best, first.candidate)
    assert len(best.found) == 2

    def build(explanation: Explanation) -> Robot:
        """With the friction's number as it is: one that is not exact stands out of the noise."""
        own = (EffectUse(effect=t.effect.id, at=t.at, **t.own) for t in explanation.terms)
        uses = tuple(FRICTION if use.effect == FRICTION.effect else use for use in own)
        return lacks.model_copy(update={"effects": uses})

    replay = Replay.of(lacks, recordings)
    assert replay is not None
    weighed = [Weighed(term, 0.9, ()) for term in best.found]
    found, kept, gone = arbitrated(replay, best, weighed, build, nuisance=False, progress=lambda phrase: None)
    assert [t.effect.id for t in found.found] == ["coulomb_friction"]
    assert [w.term.effect.id for w in kept] == ["coulomb_friction"]
    assert [(t.effect.id, why) for t, why in gone] == [("torque_ripple", NO_RUN_NEEDS)]


def test_a_name_that_keeps_runs_from_what_was_recorded_goes() -> None:
    """Where other numbers are not exact neither run comes down to the noise."""
    with_it, without = AXIS.with_effects(FRICTION), AXIS.model_copy(update={"name": "without"})

    def replay(mine: float, theirs: float) -> Replay:
        energies = {AXIS.name: 1e5, without.name: theirs}
        return SimpleNamespace(  # type: ignore[return-value]
            robot=AXIS,
            asked=(None, None),
            energies=lambda robot, _: np.full(4, mine if robot is with_it else energies[robot.name]),
        )

    assert _hinders(replay(130.0, 10.0), with_it, without)
    assert not _hinders(replay(10.0, 130.0), with_it, without)
    assert not _hinders(replay(130.0, 90.0), with_it, without)  # less than a regression may say for the name
    assert not _hinders(replay(9e4, 5e4), with_it, without)  # neither is what is there


def test_what_runs_cannot_tell_apart_a_regression_cannot_either() -> None:
    """Runs hold all that was recorded: where two come as close to it, odds are what numbers cost."""
    replay = Replay.of(AXIS, [simulate(AXIS, seed=1)])
    assert replay is not None
    rows = len(replay.asked[0].recording)
    near, same, worse = [np.array([0.99, 1.01])], [np.array([0.99, 1.01])], [np.array([0.99, 1.03])]
    assert told_apart(replay, near, same, 0) == 0.0
    assert told_apart(replay, near, same, -2) == pytest.approx(np.log(rows))
    assert told_apart(replay, near, worse, 0) == pytest.approx(0.5 * rows * 0.02)
    # one of two leaves more than noise: numbers may be inexact, and that is for runs to say
    assert told_apart(replay, near, [np.array([0.99, 2.0])], 0) == REGRESSION


@pytest.mark.proof
def test_a_mass_and_a_gain_of_the_drive_that_do_the_same_are_reported_together() -> None:
    """Without friction and gravity nothing but the product of mass and gain moves an axis."""
    plain = AXIS.model_copy(update={"effects": ()})
    heavier = plain.links[0].model_copy(update={"mass": 0.7 * plain.links[0].mass})
    real = plain.model_copy(update={"links": (heavier,)})
    recordings = [simulate(r, seed=k) for k, r in enumerate((real, otherwise(real)))]
    found = diagnose(plain, recordings[:1], recordings[1:], options=QUICK).diagnosis
    assert found.verdict == "ambiguous"
    [finding] = found.findings
    told = {f"{finding.effect}@{finding.location}", *finding.ambiguous_with}
    assert "payload@carriage" in told  # a gain of a third no drive has
