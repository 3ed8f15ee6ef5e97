"""In the end each name has a size that is not nothing, and one law has one name."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from diagnosis_cases import AXIS, Array, bare, plain_view, problem_of, recorded, term

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.final_model import FinalModel
from missing_physics.diagnosis.naming.judge import Weighed
from missing_physics.diagnosis.naming.needless import without_needless
from missing_physics.diagnosis.preparation.setup import inertial_basis
from missing_physics.diagnosis.run_search.sizes import MAY_BE_NOTHING, has_size, sure_of_size
from missing_physics.diagnosis.terms.term import Term
from robot_model import EffectUse

ROBOT = bare("single_axis", noise=True)
SPRING = term("cable_spring", "joint1", stiffness=1.0, torque_at_zero=0.0)
OFFSET = term("torque_offset", "joint1", torque=0.0)
DRY = term("coulomb_friction", "joint1", torque=1.0)


def pulled(stiffness: float, offset: float, dry: float, *terms: Term, seed: int = 5) -> Explanation:
    """Of an axis with a spring, a constant force and friction."""

    def extra(t: Array, q: Array, v: Array, a: Array) -> Array:
        return stiffness * q - offset + dry * np.tanh(v / 1e-3)

    problem = problem_of(ROBOT, recorded(ROBOT, AXIS, extra, seed=seed))
    return explain(problem, plain_view(problem, scale=problem.noise_floor), terms, nuisance=False)


def model_of(best: Explanation) -> FinalModel:
    segments = best.problem.segments
    return FinalModel(ROBOT, inertial_basis(ROBOT, segments), best, nuisance=False)


def ended(best: Explanation) -> tuple[Explanation, tuple[Weighed, ...], list[tuple[str, str]]]:
    weighed = [Weighed(t, 0.9 - 0.1 * k, ()) for k, t in enumerate(best.found)]
    best, weighed_after, gone = sure_of_size(
        best, weighed, None, lambda _: None, model_of, nuisance=False, progress=lambda _: None
    )
    return best, weighed_after, [(t.label, why) for t, why in gone]


def test_a_spring_without_stiffness_is_the_force_that_is_left() -> None:
    best, weighed, gone = ended(pulled(0.0, -13.0, 20.0, SPRING, DRY))
    assert {t.label for t in best.found} == {"torque_offset@joint1", "coulomb_friction@joint1"}
    assert {w.term.label for w in weighed} == {t.label for t in best.found}
    assert gone == [("cable_spring@joint1", MAY_BE_NOTHING)]
    offset = next(t for t in best.found if t.effect.id == "torque_offset")
    low, high = best.intervals(offset)["torque"]
    assert low - 0.1 < -13.0 < high + 0.1
    # what cannot be told apart is said with it
    assert next(w for w in weighed if w.term.key == offset.key).alternatives


def test_names_with_a_size_stay() -> None:
    given = pulled(300.0, -13.0, 20.0, SPRING, DRY)
    best, weighed, gone = ended(given)
    assert best is given
    assert len(weighed) == 2
    assert not gone
    assert all(has_size(model_of(best), t) for t in best.found)


def test_a_size_that_may_be_nothing_is_no_name() -> None:
    best, weighed, gone = ended(pulled(300.0, -13.0, 0.0, SPRING, DRY))
    assert [t.label for t in best.found] == ["cable_spring@joint1"]
    assert len(weighed) == 1
    assert [label for label, _ in gone] == ["coulomb_friction@joint1"]


def test_what_the_robot_file_has_may_be_nothing() -> None:
    """Friction that the file has and the robot has not is a finding."""
    given = pulled(300.0, -13.0, 0.0, SPRING, DRY)
    model = model_of(given)
    dry = next(t for t in given.found if t.key == DRY.key)
    assert not has_size(model, dry)
    model.robot = ROBOT.with_effects(EffectUse(effect="coulomb_friction", at="joint1", torque=20.0))
    assert has_size(model, dry)


def test_a_name_is_surer_of_its_size_than_one_of_all_may_be_by_chance() -> None:
    """Noise makes something of 3 standard deviations in one of ten robots.

    And of an event, which may be at any time, more.
    """
    hit = term("external_torque", "joint1", torque=1.0, start=3.0, duration=0.5)

    def sized(term: Term, high: float, rows: int) -> bool:
        names = {p.name: (high - 2.0 * 1.96, high) for p in term.estimated}  # of a standard deviation of one
        problem = SimpleNamespace(time=np.arange(rows), joints=("joint1",))
        explanation = SimpleNamespace(problem=problem)
        told = SimpleNamespace(robot=ROBOT, intervals=lambda _: names, explanation=explanation)
        return has_size(cast(FinalModel, told), term)

    assert sized(SPRING, 3.3 + 1.96, 200)
    assert not sized(SPRING, 3.1 + 1.96, 200)
    assert not sized(hit, 3.5 + 1.96, 200)
    assert sized(hit, 3.5 + 1.96, 4)  # two times
    assert not sized(hit, 4.2 + 1.96, 200)
    assert sized(hit, 4.5 + 1.96, 200)
    assert sized(hit, 1.96 - 4.5, 200)


def test_a_force_beside_a_spring_is_the_springs_own() -> None:
    """As torques along the motion, and with numbers that runs tell."""
    whole = pulled(300.0, -13.0, 20.0, SPRING, DRY)
    part = replace(SPRING, unseen=("torque_at_zero",))
    for held in ({}, {"stiffness": 0.5, "torque": 0.1}):
        told = {name: size for name, size in held.items() if name == "stiffness"}
        force = {name: size for name, size in held.items() if name == "torque"}
        values = {"stiffness": 300.0, "torque_at_zero": 0.0}
        given = pulled(
            300.0,
            -13.0,
            20.0,
            replace(part, held=told, parameters=values),
            replace(OFFSET, held=force, parameters={"torque": -13.0}),
            DRY,
        )
        best, weighed, gone = ended(given)
        assert {t.label for t in best.found} == {"cable_spring@joint1", "coulomb_friction@joint1"}
        assert not gone
        spring = next(t for t in best.found if t.key == SPRING.key)
        assert spring.parameters["torque_at_zero"] == pytest.approx(-13.0, abs=0.2)
        assert spring.held.get("torque_at_zero") == (held.get("torque"))
        assert next(w for w in weighed if w.term.key == SPRING.key).probability == 0.9
        # the same torque as before
        before = given if held else whole
        assert (best.errors**2).sum() == pytest.approx((before.errors**2).sum(), rel=1e-6)


def test_what_was_left_out_of_a_law_comes_back_before_another_name_is_needed() -> None:
    part = replace(SPRING, unseen=("torque_at_zero",))
    best, dropped = without_needless(pulled(300.0, -13.0, 20.0, part, OFFSET, DRY), (), nuisance=False)
    assert {t.label for t in best.found} == {"cable_spring@joint1", "coulomb_friction@joint1"}
    assert [t.label for t, _ in dropped] == ["torque_offset@joint1"]
