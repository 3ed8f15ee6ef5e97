"""One explanation: exact on exact data, inside its bounds, and weighed with the right sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import AXIS, Array, Extra, bare, plain_view, problem_of, recorded, term

from missing_physics.diagnosis.candidates.fitted import slim
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate
from robot_model import EffectUse

ROBOT = bare("single_axis")
NOISY = bare("single_axis", noise=True)


def friction(coulomb: float, viscous: float, offset: float = 0.0) -> Extra:
    return lambda t, q, qd, qdd: coulomb * np.sign(qd) + viscous * qd - offset


def fitted(extra: Extra, *terms: Term, mass: float = 95.0, seed: int | None = None) -> Explanation:
    robot = NOISY if seed is not None else ROBOT
    nominal = robot.model_copy(update={"links": (robot.links[0].model_copy(update={"mass": mass}),)})
    problem = problem_of(nominal, recorded(robot, AXIS, extra, seed=seed))
    return explain(problem, plain_view(problem), terms)


def parameters(explanation: Explanation) -> dict[str, float]:
    return {name: value for t in explanation.terms for name, value in zip(t.free, t.values)}


DRY = term("coulomb_friction", "joint1", torque=0.0)
WET = term("viscous_friction", "joint1", coefficient=0.0)
OFF = term("torque_offset", "joint1", torque=0.0)


def test_linear_laws_and_the_mass_are_found_exactly() -> None:
    found = fitted(friction(20.0, 200.0, 3.0), DRY, replace(WET), OFF, mass=80.0)
    [both] = [p for p in found.terms if p.effect.id == "coulomb_friction"]
    # exact but for the sign within 2e-4 of the top speed of zero, which the weights leave out
    assert both.parameters["torque"] == pytest.approx(20.0, rel=1e-4)
    assert found.terms[1].parameters["coefficient"] == pytest.approx(200.0, rel=1e-4)
    assert found.terms[2].parameters["torque"] == pytest.approx(3.0, rel=1e-3)
    problem = found.problem
    change = problem.nuisance[:, 0] @ found.nuisance
    acceleration = problem.measured - 20 * np.sign(problem.velocity) - 200 * problem.velocity + 3.0
    rows = problem.sliding[:, 0] > 0
    # 15 kg of 95 kg, seen through the filter: ringing after reversals is a thousandth of the whole
    slope = change[rows] @ acceleration[rows, 0] / (acceleration[rows, 0] @ acceleration[rows, 0])
    assert slope == pytest.approx(15.0 / 95.0, rel=1e-2)


def test_a_nonlinear_law_is_found_from_a_start_elsewhere() -> None:
    def stribeck(t: Array, q: Array, qd: Array, qdd: Array) -> Array:
        return (15.0 + 12.0 * np.exp(-((qd / 0.03) ** 2))) * np.sign(qd)

    start = term("stribeck_friction", "joint1", coulomb_torque=5.0, static_torque=5.0, stribeck_velocity=0.08)
    found = parameters(fitted(stribeck, start))
    # Gauss-Newton stops when a step gains less than 1e-5 of the energy
    assert found["coulomb_torque"] == pytest.approx(15.0, rel=2e-3)
    assert found["static_torque"] == pytest.approx(27.0, rel=2e-2)
    assert found["stribeck_velocity"] == pytest.approx(0.03, rel=2e-2)


def test_nothing_is_left_of_exact_data() -> None:
    found = fitted(friction(0.0, 150.0, -2.0), WET, OFF)
    # the ends, where the filter has no past, are worse than the middle
    assert np.abs(found.residual[20:-20]).max() < 1e-5 * np.abs(found.problem.measured).max()
    assert np.abs(found.residual).max() < 5e-3 * np.abs(found.problem.measured).max()
    np.testing.assert_allclose(found.predict(found.problem) + found.residual, found.problem.measured)


def test_bounds_hold_and_the_rest_is_refitted() -> None:
    """A negative coefficient is not credible: it stops at zero, and the offset is as if it were not there."""
    found = fitted(friction(0.0, -50.0, 3.0), WET, OFF)
    assert found.terms[0].parameters["coefficient"] == 0.0
    alone = fitted(friction(0.0, -50.0, 3.0), OFF)
    assert found.terms[1].values == pytest.approx(alone.terms[0].values, rel=1e-6)
    narrow = replace(WET, narrowed={"coefficient": (0.0, 60.0)})
    assert fitted(friction(0.0, 150.0), narrow).terms[0].parameters["coefficient"] == 60.0


LEVEL = term("stribeck_friction", "joint1", coulomb_torque=5.0, static_torque=6.0, stribeck_velocity=0.03)


def rounded(t: Array, q: Array, qd: Array, qdd: Array) -> Array:
    return (20.0 - 8.0 * np.exp(-((qd / 0.03) ** 2))) * np.sign(qd)


def test_friction_at_rest_is_never_fitted_below_that_of_sliding() -> None:
    """Where the torque falls near rest the law without a peak fits best, and loses nothing by that."""

    found = fitted(rounded, LEVEL)
    level = parameters(found)
    assert level["static_torque"] == pytest.approx(level["coulomb_torque"], rel=1e-9)
    flat = fitted(rounded, DRY)
    assert level["coulomb_torque"] == pytest.approx(parameters(flat)["torque"], rel=1e-6)
    assert found.energies.sum() == pytest.approx(flat.energies.sum(), rel=1e-6)


def test_two_numbers_that_a_fit_made_equal_go_on_as_one() -> None:
    found = slim(fitted(rounded, LEVEL), LEVEL.key)
    [law] = found.terms
    assert "static_torque" not in law.free
    moved = law.at_values(law.values + 1.0)
    assert moved.parameters["static_torque"] == moved.parameters["coulomb_torque"]
    made = [found.problem.segments[0].contribution(t) for t in (law, moved)]
    column = made[0].jacobian[:, :, law.free.index("coulomb_torque")]
    # both numbers at once: the whole change of the torque, which is linear in them
    np.testing.assert_allclose(made[1].value - made[0].value, column, atol=1e-9)


@pytest.mark.parametrize(("height", "free"), [(0.0, ("mass", "x")), (0.3, ("mass", "x", "z"))])
def test_a_place_that_cannot_be_distinguished_from_the_frame_is_no_number(
    height: float, free: tuple[str, ...]
) -> None:
    """A payload on the link's axis is a mass and a distance, as an inertia is a first and a second moment."""
    robot = bare("two_link_arm", noise=True)
    load = {"effect": "payload", "at": "link1", "mass": 2.0, "x": 0.5, "y": 0.0, "z": height}
    real = robot.with_effects(EffectUse.model_validate(load))
    problem = problem_of(robot, simulate(real, seed=7))
    start = term("payload", "link1", mass=1.0, x=0.4, z=0.1)
    blind = replace(start, unseen=("y",))  # along the axis of both joints
    found = slim(explain(problem, plain_view(problem), [blind], nuisance=False), start.key)
    [law] = found.terms
    assert law.free == free
    assert law.parameters["mass"] == pytest.approx(2.0, rel=0.05)


def test_numbers_that_runs_tell_stay_with_their_spread_and_others_are_fitted() -> None:
    held = replace(term("coulomb_friction", "joint1", torque=18.0), held={"torque": 0.25})
    found = fitted(friction(20.0, 200.0), held, WET, mass=95.0)
    assert found.terms[0].parameters["torque"] == 18.0
    low, high = found.intervals(found.terms[0])["torque"]
    assert (low, high) == pytest.approx((18.0 - 1.96 * 0.25, 18.0 + 1.96 * 0.25))
    assert found.terms[1].parameters["coefficient"] == pytest.approx(200.0, rel=0.2)
    free = fitted(friction(20.0, 200.0), held.released, WET, mass=95.0)
    assert free.terms[0].parameters["torque"] == pytest.approx(20.0, rel=1e-4)


@pytest.mark.parametrize(
    "held", [("static_torque", "coulomb_torque"), ("static_torque",), ("coulomb_torque",)]
)
def test_of_two_numbers_in_order_one_may_be_held(held: tuple[str, ...]) -> None:
    """The held one bounds the other, and neither spoils the step of a third."""
    start = {"static_torque": 21.0, "coulomb_torque": 20.0}
    law = replace(LEVEL, parameters={**LEVEL.parameters, **start}, held=dict.fromkeys(held, 0.1))
    found = fitted(lambda t, q, qd, qdd: rounded(t, q, qd, qdd) + 200.0 * qd, law, WET)
    level = parameters(found)
    assert {name: level[name] for name in held} == {name: start[name] for name in held}
    assert level["static_torque"] >= level["coulomb_torque"]
    assert level["coefficient"] == pytest.approx(200.0, rel=0.25)  # the law is another than the force


def test_frozen_terms_stay_and_unseen_parameters_stay() -> None:
    frozen = replace(term("viscous_friction", "joint1", coefficient=70.0), frozen=True)
    found = fitted(friction(10.0, 70.0), frozen, DRY)
    assert found.terms[0].parameters["coefficient"] == 70.0
    assert found.terms[1].parameters["torque"] == pytest.approx(10.0, rel=1e-4)
    spring = term("cable_spring", "joint1", stiffness=0.0, torque_at_zero=0.0)
    held = replace(spring, unseen=("stiffness",))
    assert fitted(lambda t, q, qd, qdd: 90.0 * q, held).terms[0].parameters["stiffness"] == 0.0


def test_intervals_hold_the_truth_and_shrink_with_the_noise() -> None:
    found = fitted(friction(20.0, 200.0), DRY, WET, seed=3)
    for t, true in zip(found.terms, (20.0, 200.0)):
        [(low, high)] = found.intervals(t).values()
        [value] = t.values
        assert low < true < high
        assert low < value < high
        # the sensor's 0.5 N, averaged over some thousand samples
        assert (high - low) / 2 < 0.02 * true


def test_evidence_is_for_what_is_there_and_against_what_is_not() -> None:
    there = fitted(friction(20.0, 200.0), WET, DRY, seed=4)
    view, problem = there.view, there.problem
    simpler = explain(problem, view, [WET])
    assert there.evidence_over(simpler) > 100
    assert simpler.evidence_over(there) < -100
    spring = term("cable_spring", "joint1", stiffness=0.0, torque_at_zero=0.0)
    more = explain(problem, view, [WET, DRY, spring])
    # two needless parameters cost log(samples) in all, less what chance gains
    assert -15 < more.evidence_over(there) < 0
    assert there.evidence_over(there) == 0.0
    assert more.size == there.size + 2


def test_an_effect_that_swallows_the_torque_gains_no_evidence() -> None:
    """A drive that lets a tenth of the torque through leaves a tenth of the error, and explains nothing."""

    def foreign(t: Array, q: Array, qd: Array, qdd: Array) -> Array:
        return 60.0 * np.sin(2 * np.pi * 1.3 * t) - 95.0 * qdd

    light = ROBOT.links[0].model_copy(update={"mass": 0.5})
    robot = ROBOT.model_copy(update={"links": (light,), "known": ("carriage",)})
    problem = problem_of(robot, recorded(ROBOT, AXIS, foreign))
    view = plain_view(problem)
    nothing = explain(problem, view, [])
    swallowing = explain(problem, view, [term("torque_gain", "joint1", gain_error=0.0)])
    assert swallowing.terms[0].parameters["gain_error"] < -0.8
    assert swallowing.energies.sum() < 0.05 * nothing.energies.sum()
    assert swallowing.evidence_over(nothing) < 0.0


def test_prior_holds_inertial_numbers_back() -> None:
    """With a prior as strong as the data, half of the change is believed."""
    problem = problem_of(
        ROBOT.model_copy(update={"links": (ROBOT.links[0].model_copy(update={"mass": 80.0}),)}),
        recorded(ROBOT, AXIS),
    )
    free = explain(problem, plain_view(problem), [])
    column = free.columns[:, 0]
    held = explain(problem, replace(plain_view(problem), prior=float(column @ column)), [])
    assert held.nuisance[0] == pytest.approx(0.5 * free.nuisance[0], rel=1e-6)
    kept = explain(problem, plain_view(problem), [], nuisance=False)
    assert kept.nuisance.size == 0
    np.testing.assert_array_equal(kept.residual, problem.residual)


def test_views_choose_rows_and_weights() -> None:
    problem: Problem = problem_of(ROBOT, recorded(ROBOT, AXIS, friction(20.0, 0.0)))
    view = plain_view(problem)
    half = replace(view, rows=problem.time < problem.time.mean())
    ones = np.ones((problem.time.size, 1, 1))
    np.testing.assert_array_equal(view.flatten(problem, ones)[:, 0], problem.sliding[:, 0])
    assert half.flatten(problem, ones).shape[0] == half.rows.sum()
    whole = replace(view, reversals=True, scale=np.array([2.0]))
    np.testing.assert_array_equal(whole.flatten(problem, ones)[:, 0], problem.moving[:, 0] / 2.0)


def test_an_explanation_without_its_term_knows_no_slice() -> None:
    found = fitted(friction(0.0, 10.0), WET)
    with pytest.raises(KeyError):
        found.slice_of(DRY)


def test_below_the_noise_floor_a_hidden_mode_finds_no_evidence() -> None:
    """A damped mode undoes the noise that shakes it; other laws cannot, and are not held to the floor."""
    plain = fitted(friction(5.0, 20.0), WET, seed=1)
    noise = float(plain.noise[0])

    def leaving(part: float, *terms: Term) -> Explanation:
        own = replace(plain, terms=(*plain.terms, *terms))
        own.__dict__["referred"] = np.array([part * noise])  # where the cached property keeps its value
        own.__dict__["effective"] = np.array([100.0])
        return own

    bent = Term(
        get_effect("link_flexibility"), "carriage", {"period": 0.1, "damping_ratio": 0.5, "modes": 1.0}
    )
    assert leaving(0.1, bent).evidence_over(leaving(0.9)) < 0.0
    assert leaving(0.1, DRY).evidence_over(leaving(0.9)) > 50.0
    # what comes down to the floor counts as far as that
    reached = leaving(1.0, bent).evidence_over(leaving(5.0))
    assert leaving(0.1, bent).evidence_over(leaving(5.0)) == pytest.approx(reached)
    assert reached > 50.0
