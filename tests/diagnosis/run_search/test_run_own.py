"""Recordings that the robot file's own numbers explain."""

from __future__ import annotations

import numpy as np
import pytest
from end_to_end_cases import AXIS, QUICK, otherwise, shortened
from rescue_cases import deafened

from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.view import Told
from missing_physics.diagnosis.naming.judge import Weighed
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments, nominal_terms
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.run_search.own_numbers import OwnNumbers, by_own_numbers
from missing_physics.diagnosis.run_search.wrong_links import wrong_links
from missing_physics.diagnosis.runs.fit import errors_of
from missing_physics.diagnosis.runs.nominal import own_numbers
from missing_physics.diagnosis.runs.numbers import as_given
from missing_physics.diagnosis.written.augment import augmented_robot, with_masses
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot

pytestmark = pytest.mark.proof

VISCOUS = EffectUse(effect="viscous_friction", at="joint1", coefficient=3.0)
DRY = EffectUse(effect="coulomb_friction", at="joint2", torque=1.2)
#: In a vertical plane, with friction.
ARM = shortened("two_link_arm", duration=6.0, rate=250.0).model_copy(update={"effects": (VISCOUS, DRY)})


def heavier(robot: Robot, **factors: float) -> Robot:
    """Links with so many times the mass, of the same shape."""
    links = tuple(
        link.model_copy(
            update={
                "mass": link.mass * factors.get(link.name, 1.0),
                "inertia": tuple(i * factors.get(link.name, 1.0) for i in link.inertia),
            }
        )
        for link in robot.links
    )
    return robot.model_copy(update={"links": links})


def rubbing(robot: Robot, *effects: EffectUse) -> Robot:
    return robot.model_copy(update={"effects": effects})


def told(real: Robot, file: Robot = ARM) -> OwnNumbers | None:
    recordings = [simulate(r, seed=50 + k) for k, r in enumerate((real, otherwise(real)))]
    segments = make_segments(file, recordings)
    basis = inertial_basis(file, segments[:1])
    data = split(segments, 1, basis, seed=0)
    start = as_given(explain(data.problem, data.view, nominal_terms(file), nuisance=False))
    replay = Replay.of(file, recordings[:1], recordings[1:])
    assert replay is not None
    errors = errors_of(replay, file)
    assert errors is not None

    def build(best: Explanation) -> Robot | None:
        changed, remark = with_masses(augmented_robot(file, best.terms), basis, best)
        return None if remark else changed

    found = by_own_numbers(replay, start, own_numbers(start, basis, 20), basis, errors, build)
    if found is not None:  # which is what they are
        energies = [replay.energies(build(found.explanation) or file, which) for which in range(2)]
        assert all(e is not None and float(e.max()) < 1.1 for e in energies)
    return found


def named(weighed: tuple[Weighed, ...]) -> set[tuple[str, str]]:
    return {item.term.key for item in weighed}


def test_a_file_that_is_off_everywhere_says_which_link_is_off_most() -> None:
    factors = {"link1": 1.02, "link2": 1.15}
    real = rubbing(heavier(ARM, **factors), VISCOUS, DRY.model_copy(update={"torque": 1.21}))
    found = told(real)
    assert found is not None
    assert named(found.weighed) == {("inertia", "link2")}  # not friction, which is off by a hundredth
    [item] = found.weighed
    link = ARM.link("link2")
    wanted = {
        "mass": 0.15 * link.mass,
        "first_moment_x": 0.15 * link.mass * link.center_of_mass[0],
        "inertia_yy": 0.15 * (link.inertia[1] + link.mass * link.center_of_mass[0] ** 2),
    }
    assert {"first_moment_x", "inertia_yy"} <= set(item.term.held)  # the mass is seen with link 1's only
    for name in set(wanted) & set(item.term.held):
        assert abs(item.term.parameters[name] - wanted[name]) < 4 * item.term.held[name]
    assert item.probability + sum(p for _, p in item.alternatives) == pytest.approx(0.8, abs=0.01)
    dry = next(t for t in found.explanation.terms if t.key == ("coulomb_friction", "joint2"))
    assert dry.nominal
    assert abs(dry.parameters["torque"] - 1.21) < 4 * dry.held["torque"]


def test_a_load_beside_masses_that_are_a_little_off_is_a_load() -> None:
    """Combinations have to go far together, through robots that run hardly nearer."""
    load = EffectUse(effect="payload", at="link2", mass=0.8, x=0.35, z=-0.05)
    found = told(heavier(ARM, link1=1.02, link2=0.99).with_effects(load))
    assert found is not None
    [item] = found.weighed
    assert item.term.key == ("payload", "link2")
    assert ("inertia", "link2") in {term.key for term, _ in item.alternatives}
    for name, value in {"mass": 0.8, "x": 0.35, "z": -0.05}.items():
        assert abs(item.term.parameters[name] - value) < 4 * item.term.held[name]


def test_where_friction_is_what_is_off_no_masses_are_named() -> None:
    laws = VISCOUS.model_copy(update={"coefficient": 4.0}), DRY.model_copy(update={"torque": 1.7})
    real = rubbing(heavier(ARM, link1=1.001), *laws)
    found = told(real)
    assert found is not None
    assert named(found.weighed) == {("viscous_friction", "joint1"), ("coulomb_friction", "joint2")}
    values = {t.at: t.values for t in found.explanation.found}
    assert values["joint1"] == pytest.approx(4.0, rel=0.01)
    assert values["joint2"] == pytest.approx(1.7, rel=0.01)


def test_what_they_do_not_explain_is_left_alone() -> None:
    assert told(ARM.with_effects(EffectUse(effect="cable_spring", at="joint1", stiffness=20.0))) is None


@pytest.mark.proof
def test_a_carriage_with_another_mass_and_friction_than_the_file_has(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where torques along the motion tell of nothing; no one number is enough."""
    deafened(monkeypatch)
    file = AXIS.model_copy(update={"effects": (VISCOUS,)})
    [carriage] = file.links
    real = heavier(rubbing(file, VISCOUS.model_copy(update={"coefficient": 30.0})), **{carriage.name: 1.1})
    recordings = [simulate(r, seed=k) for k, r in enumerate((real, otherwise(real)))]
    found = diagnose(file, recordings[:1], recordings[1:], options=QUICK).diagnosis
    assert {(f.effect, f.location) for f in found.findings} == {
        ("viscous_friction", "joint1"),
        ("payload", carriage.name),
    }
    masses = found.findings[-1]
    assert masses.ambiguous_with == (f"inertia@{carriage.name}",)  # its one number is told by nothing else
    assert found.fit.validation_improvement > 0.6  # all that stands out of the torque's noise


def test_an_effect_that_is_there_already_is_no_wrong_link() -> None:
    """A load of a file beside another one in the same place: one of them would have the other's numbers."""
    segments = make_segments(ARM, [simulate(ARM, seed=60)])
    basis = inertial_basis(ARM, segments)
    change = Told(np.full(basis.most, 0.05), 1e-4 * np.eye(basis.most))
    some = {item.term.key for item in wrong_links(ARM, basis, change)}
    assert some
    assert {item.term.key for item in wrong_links(ARM, basis, change, some)} & some == set()
