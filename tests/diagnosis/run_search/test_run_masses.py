"""Loads and wrong mass properties, of one link or another, by runs in closed loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from end_to_end_cases import otherwise, shortened

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.judge import Weighed
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments, nominal_terms
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.run_search.masses import _evidence, _ordered, _Told, masses_told
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.written.words import NO_RUN_NEEDS
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot

pytestmark = pytest.mark.proof

#: In a vertical plane, without friction.
ARM = shortened("two_link_arm", duration=6.0, rate=250.0).model_copy(update={"effects": ()})
#: A link that is heavier by 7 %, with the same shape: no point of mass has its three numbers.
LINK = ARM.link("link2")
HEAVIER = {
    "mass": 0.07 * LINK.mass,
    "first_moment_x": 0.07 * LINK.mass * LINK.center_of_mass[0],
    "inertia_yy": 0.07 * (LINK.inertia[1] + LINK.mass * LINK.center_of_mass[0] ** 2),
}


def told(
    hidden: EffectUse, named: Term, *beside: Term, other: float = 0.0, file: Robot = ARM
) -> tuple[Weighed, list[tuple[str, str]]]:
    """What is left of the name, and what is not needed, in recordings with something hidden.

    Args:
        named: what a regression made of it.
        beside: what it named as well.
        other: probability that it gave to a gain of the drive in the place of `named`.
        file: the robot as described; the real one has its loads and what is hidden, and no friction.
    """
    loads = [use for use in file.effects if use.effect == "payload"]
    real = ARM.with_effects(hidden, *loads)
    recordings = [simulate(r, seed=30 + k) for k, r in enumerate((real, otherwise(real)))]
    segments = make_segments(file, recordings)
    data = split(segments, 1, inertial_basis(file, segments[:1]), seed=0)
    there = [term for term in nominal_terms(file) if term.key not in {t.key for t in (named, *beside)}]
    best = explain(data.problem, data.view, [*there, named, *beside], nuisance=False)
    replay = Replay.of(file, recordings[:1], recordings[1:])
    assert replay is not None
    gain = Term(get_effect("torque_gain"), "joint2", {"gain_error": 0.01})
    rival = ((gain, other),) if other else ()
    weighed = [Weighed(t, 0.9, rival if t.key == named.key else ()) for t in best.found]

    found, kept, gone = masses_told(
        replay,
        best,
        weighed,
        lambda e: ARM.with_effects(*(EffectUse(effect=t.effect.id, at=t.at, **t.own) for t in e.terms)),
        lambda phrase: None,
    )
    assert {t.key for t in found.found} == {w.term.key for w in kept}
    assert all(why == NO_RUN_NEEDS for _, why in gone)
    [item] = [w for w in kept if w.term.effect.id in ("payload", "inertia")]
    return item, [t.key for t, _ in gone]


def of(effect: str, at: str, values: Mapping[str, float]) -> EffectUse:
    return EffectUse(effect=effect, at=at, **values)


def load(at: str, mass: float, x: float) -> Term:
    return Term(get_effect("payload"), at, {"mass": mass, "x": x, "y": 0.0, "z": 0.0}, unseen=("y", "z"))


def test_a_link_that_is_heavier_is_no_load() -> None:
    gain = Term(get_effect("torque_gain"), "joint1", {"gain_error": -2e-4})
    item, gone = told(of("inertia", "link2", HEAVIER), load("link2", 0.2, 0.2), gain, other=0.05)
    assert item.term.key == ("inertia", "link2")
    assert gone == [("torque_gain", "joint1")]
    assert [t.key for t, _ in item.alternatives] == [("torque_gain", "joint2")]  # of which masses say nothing
    assert item.probability == pytest.approx(0.9)
    for name, value in HEAVIER.items():
        assert abs(item.term.parameters[name] - value) < 4 * item.term.held[name]


def test_a_load_near_the_base_is_distinguished_from_its_neighbour_s_not_from_wrong_mass() -> None:
    """Two of its numbers show, and a load has two: nothing tells them apart."""
    item, _ = told(of("payload", "link1", {"mass": 0.6, "x": 0.3}), load("link2", 0.3, 0.05))
    assert item.term.key == ("payload", "link1")
    [(rival, likely)] = item.alternatives
    assert rival.key == ("inertia", "link1")
    assert likely == pytest.approx(0.45)
    assert item.probability == pytest.approx(0.45)
    off = np.array([item.term.parameters[name] for name in ("mass", "x")]) - [0.6, 0.3]
    assert np.all(np.abs(off) < 4 * np.array([item.term.held[name] for name in ("mass", "x")]))


@pytest.mark.parametrize(
    ("mass", "behind", "first", "odds"),
    [
        (0.5, 3.0, "payload", 0.0),  # within what the model may err by
        (0.5, 5.0, "inertia", -1.0),
        (-0.5, 3.0, "inertia", 0.0),  # nobody takes a load off that nobody put on
    ],
)
def test_of_what_is_as_likely_a_load_comes_first(mass: float, behind: float, first: str, odds: float) -> None:
    explanation = cast(Explanation, None)
    wrong = _Told(explanation, Term(get_effect("inertia"), "link1", {"mass": 0.0}), -100.0)
    carried = _Told(explanation, load("link1", mass, 0.3), -100.0 - behind)
    ordered = _ordered([carried, wrong], 4.0)
    assert ordered[0].term.effect.id == first
    assert [t.evidence for t in ordered] == [0.0, pytest.approx(odds)]


def test_a_number_that_might_as_well_be_nothing_costs_next_to_nothing() -> None:
    replay = cast(Replay, SimpleNamespace(asked=[SimpleNamespace(recording=range(500))], channels=("a", "b")))
    told = Term(get_effect("inertia"), "link1", {"mass": 1.0, "first_moment_x": 0.1}, held={"mass": 1e-3})
    unsure = replace(told, held={**told.held, "first_moment_x": 0.1})
    alone = _evidence(replay, told, [2.0])
    assert alone == pytest.approx(-0.5 * 500 * 2.0 - 0.5 * np.log(1000))
    assert _evidence(replay, unsure, [2.0]) == pytest.approx(alone - 0.5)


def test_where_something_else_is_missing_masses_are_left_alone() -> None:
    hidden = EffectUse(effect="coulomb_friction", at="joint1", torque=3.0)
    named = load("link2", 0.2, 0.2)
    item, gone = told(hidden, named)
    assert item.term.key == named.key
    assert not item.term.held
    assert gone == []


def test_friction_of_the_file_that_is_not_there_stays_named() -> None:
    """Without the name the robot has the friction of its file again, which is too much."""
    listed = EffectUse(effect="coulomb_friction", at="joint1", torque=3.0)
    freed = Term(get_effect("coulomb_friction"), "joint1", {"torque": 0.01})
    hidden = of("payload", "link2", {"mass": 0.4, "x": 0.35})
    item, gone = told(hidden, load("link2", 0.41, 0.34), freed, file=ARM.with_effects(listed))
    assert item.term.key == ("payload", "link2")
    assert item.term.held
    assert gone == []


def test_a_load_that_the_file_lists_is_none_of_the_rivals() -> None:
    """Two in the same place would have the same numbers: here a link is off as another load would make it."""
    point = {"mass": 0.3, "first_moment_x": 0.3 * 0.25, "inertia_yy": 0.3 * 0.25**2}
    near = {name: 1.05 * value for name, value in point.items()}
    named = Term(get_effect("inertia"), "link1", {**get_effect("inertia").defaults(), **near})
    file = ARM.with_effects(of("payload", "link1", {"mass": 0.5, "x": 0.2}))
    item, _ = told(of("inertia", "link1", point), named, file=file)
    assert item.term.key == ("inertia", "link1")
    assert ("payload", "link1") not in {term.key for term, _ in item.alternatives}
