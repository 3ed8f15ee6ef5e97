"""Laws of dry friction that differ from Coulomb's at slow speeds, next to quick reversals, only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recorded_arm import Hidden, nothing, recorded

from missing_physics.inference import search, weighed
from missing_physics.inference.search import standard_search
from missing_physics.inference.torques.data import TorqueData
from missing_physics.inference.torques.reversals import searched_at_reversals
from missing_physics.standard import StandardModel, fit_standard
from robot_model import Robot

EXCESS, SPEED = 0.2, 0.02  # of static over kinetic friction [N m], and the speed at which it vanishes [rad/s]


def stribeck(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    return EXCESS * np.exp(-((velocity / SPEED) ** 2)) * np.sign(velocity)


def with_reversals(standard: StandardModel) -> StandardModel:
    return replace(standard, weights=replace(standard.weights, reversals=True))


@pytest.mark.parametrize(("hidden", "law"), [(stribeck, ["stribeck_friction"]), (nothing, [])])
def test_law_that_only_reversals_show_is_named(arm: Robot, hidden: Hidden, law: list[str]) -> None:
    """The rows of the search show Coulomb friction in both cases."""
    runs = [recorded(hidden, seed=seed) for seed in (1, 2)]
    standard = fit_standard(arm, runs[:1])
    found = search(TorqueData.of(standard, runs[:1], runs[1:]))
    before = weighed(found)
    assert before.answer.hypothesis.terms == ()
    rows = TorqueData.of(with_reversals(standard), runs[:1], runs[1:])
    known = weighed(found, searched_at_reversals(found, before, lambda: rows, lambda _: None))
    assert [term.effect.id for term in known.answer.hypothesis.terms] == law
    same = [[term.effect.id for term in fit.hypothesis.terms] == law for fit in known.fits]
    assert known.weights[same].sum() > (0.6 if law else 0.9)
    assert known.weights.sum() == pytest.approx(1.0)


def test_rows_that_include_reversals_contain_those_of_the_search(arm: Robot) -> None:
    run = recorded(nothing, seed=1)
    standard = fit_standard(arm, [run])
    plain = TorqueData.of(standard, [run]).runs[0].rows
    more = TorqueData.of(with_reversals(standard), [run]).runs[0].rows
    assert plain.nuisance.is_empty
    assert np.array_equal(plain.samples, plain.counted)
    assert np.all(more.counted[plain.counted])
    assert plain.counted.sum() < more.counted.sum()
    assert more.samples.sum() < more.counted.sum()


def test_frictionless_joint_is_not_compared_anew(arm: Robot) -> None:
    """The hidden torque cancels the friction of the recording."""
    run = recorded(lambda time, position, velocity: -0.5 * np.sign(velocity), seed=1)
    found = standard_search(TorqueData.of(fit_standard(arm, [run]), [run]))

    def rows() -> TorqueData:
        raise AssertionError("rows are made without need")

    assert searched_at_reversals(found, weighed(found), rows, lambda _: None) is None
