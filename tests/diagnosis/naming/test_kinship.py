"""Laws of one family that the data hardly tell apart: the odds of each, and what they rest on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import AXIS, Array, bare, plain_view, problem_of, recorded, term

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.judge import Weighed, reweighed
from missing_physics.diagnosis.naming.kinship import Contested, contested, evidence_by_parts, odds_for, saved
from missing_physics.diagnosis.naming.reversals import _no_better, unresolved
from missing_physics.diagnosis.preparation.proof import HeldOut
from missing_physics.diagnosis.terms.term import Term

NOISY = bare("single_axis", noise=True)
DRY = term("coulomb_friction", "joint1", torque=10.0)


def dry(t: Array, q: Array, qd: Array, qdd: Array) -> Array:
    return 20.0 * np.sign(qd)


def peaked(excess: float, *, seed: int = 5) -> Explanation:
    """Coulomb friction fitted where there is a peak of `excess` near rest besides."""

    def law(t: Array, q: Array, qd: Array, qdd: Array) -> Array:
        return (20.0 + excess * np.exp(-((qd / 0.02) ** 2))) * np.sign(qd)

    problem = problem_of(NOISY, recorded(NOISY, AXIS, law, seed=seed, start=4.0 * seed))
    return explain(problem, plain_view(problem), [DRY])


def unseen(made: Explanation) -> HeldOut:
    """The data of another explanation."""
    return HeldOut(made.problem, made.view.rows, made.view.scale)


def test_a_law_above_that_was_refused_has_its_odds_and_no_more() -> None:
    for excess, low, high in ((0.0, 1.0, np.inf), (8.0, -np.inf, -20.0)):
        found = peaked(excess)
        [contest] = contested(found, unseen(peaked(excess, seed=6)), nuisance=True)
        assert contest.other.effect.id == "stribeck_friction"
        assert low < contest.evidence < high


def test_what_held_out_data_refuse_is_no_rival() -> None:
    found = peaked(8.0)
    assert contested(found, unseen(peaked(0.0, seed=6)), nuisance=True) == ()


def test_a_number_that_few_rows_tell_costs_less() -> None:
    """Half the logarithm of the part of the rows in which the law's column lies, for each number there."""
    found = peaked(0.0)
    cheaper = []
    for speed in (0.003, 0.03):
        narrow = replace(
            _stribeck(28.0), parameters={**_stribeck(28.0).parameters, "stribeck_velocity": speed}
        )
        other = explain(found.problem, found.view, [replace(narrow, unseen=("stribeck_velocity",))])
        column = other.columns[:, -1] ** 2
        alike = column.sum() ** 2 / (column**2).sum()
        cheaper.append(saved(other, found))
        # the level's own column lacks the peak, which is less than a tenth of a logarithm
        assert cheaper[-1] == pytest.approx(-0.5 * np.log(alike / found.errors.size), abs=0.15)
    assert cheaper[0] > cheaper[1] + 0.5


def test_few_rows_around_reversals_do_not_speak_for_all() -> None:
    """Halving what is left at reversals counts twice for each of them, however large it is there."""
    problem = problem_of(NOISY, recorded(NOISY, AXIS, dry, seed=5))
    before = explain(problem, replace(plain_view(problem), reversals=True), [DRY])
    chance = np.random.default_rng(0)
    near = (problem.moving > 0) & (problem.sliding == 0)
    assert 0.02 < near.mean() < 0.3
    noise = chance.standard_normal(before.residual.shape)
    one = replace(before, residual=np.where(near, 30.0 * noise, noise))
    other = replace(before, residual=np.where(near, 15.0 * noise, noise))
    turns = np.count_nonzero(np.diff(near[:, 0].astype(int), prepend=0) == 1)
    assert near.sum() > 3 * turns
    assert evidence_by_parts(other, one) == pytest.approx(2.0 * turns * np.log(2.0), rel=1e-6)
    assert other.evidence_over(one) > 3.0 * evidence_by_parts(other, one)


def test_held_out_data_that_a_law_worsens_take_its_odds() -> None:
    found = peaked(8.0)
    better = explain(found.problem, found.view, [_stribeck(28.0)])
    there = unseen(peaked(0.0, seed=6))
    assert odds_for(better, found, unseen(found)) > 20.0
    assert odds_for(better, found, there) < odds_for(better, found, unseen(found)) - 20.0


def _stribeck(static: float) -> Term:
    return term(
        "stribeck_friction", "joint1", coulomb_torque=20.0, static_torque=static, stribeck_velocity=0.02
    )


def test_a_finding_shares_with_its_kin_by_their_odds() -> None:
    found = peaked(0.0)
    [own] = found.terms
    offset = term("torque_offset", "joint1", torque=1.0)
    before = Weighed(own, 0.8, ((offset, 0.2),))
    kin = _stribeck(21.0)
    for evidence, odds in ((-5.0, 1.0), (0.0, 1.0), (2.0, np.exp(-2.0)), (1e4, 0.0)):
        [after] = reweighed(found, [before], [Contested(own, kin, evidence)])
        rivals = {t.key: p for t, p in after.alternatives}
        assert rivals[kin.key] == pytest.approx(odds * after.probability, abs=1e-12)
        assert after.probability + sum(rivals.values()) == pytest.approx(1.0)


def test_bristles_that_bend_less_than_the_accuracy_of_the_motion_are_not_seen() -> None:
    """By the encoder's noise, or by the corner that the smoother rounds at a reversal."""
    problem = problem_of(NOISY, recorded(NOISY, AXIS, dry, seed=5))
    [segment] = problem.segments
    hidden = float(segment.motion.position_noise[0])
    for travel, seen in ((0.5 * hidden, False), (100.0 * hidden, True)):
        law = {"coulomb_torque": 20.0, "static_torque": 20.0, "stribeck_velocity": 0.01}
        fresh = term("lugre_friction", "joint1", bristle_stiffness=20.0 / travel, bristle_damping=1.0, **law)
        assert (unresolved(problem, fresh, 0) == "") is seen
    slow = replace(segment.motion, motion_cutoff=0.01 * segment.motion.motion_cutoff)
    segment.motion = slow  # its corners are 1e4 times as round
    assert unresolved(problem, fresh, 0)


def test_bristles_have_to_leave_less_around_reversals_than_laws_without() -> None:
    """On a real ball screw they bent to what is left in sliding, and made reversals worse."""
    found = peaked(0.0)
    near = (found.problem.moving > 0) & (found.problem.sliding == 0)
    less, more = (replace(found, residual=found.residual * np.where(near, k, 1.0)) for k in (0.9, 1.1))
    assert _no_better(less, [found, more], 0) == ""
    assert _no_better(found, [more, less], 0)
