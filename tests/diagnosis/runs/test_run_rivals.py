"""Probabilities of what was run in the place of a name, and of what was not."""

from __future__ import annotations

import numpy as np
import pytest

from missing_physics.diagnosis.naming.judge import Weighed
from missing_physics.diagnosis.runs.rivals import REGRESSION, with_equals, without_beaten
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect


def test_what_runs_refuse_with_its_best_numbers_is_hardly_probable() -> None:
    term, beaten, other = (Term(get_effect(e), "joint1", {}) for e in ("torque_gain", "inertia", "payload"))
    [item] = without_beaten([Weighed(term, 0.2, ((beaten, 0.7), (other, 0.1)))], {beaten.key})
    chances = {t.effect.id: p for t, p in item.alternatives}
    assert chances == {"inertia": pytest.approx(0.7 * np.exp(-REGRESSION)), "payload": 0.1}
    assert item.probability + sum(chances.values()) == pytest.approx(1.0)
    assert without_beaten([item], set()) == (item,)
    # it was run in the place of another name, beside this one
    assert without_beaten([item], {other.key}, {term.key}) == (item,)


def test_what_runs_tell_no_better_than_its_equal_shares_the_probability() -> None:
    """Also what a regression, with its own numbers, calls impossible; others keep theirs."""
    term, equal, worse, other = (
        Term(get_effect(e), "joint1", {}) for e in ("inertia", "payload", "torque_gain", "cable_spring")
    )
    items = Weighed(term, 1.0 - 1e-30, ((equal, 1e-30),)), Weighed(other, 0.9, ())
    item, kept = with_equals(items, term.key, ((worse, -3.0), (equal, -0.1)))
    assert kept == items[1]
    order = [(item.term, item.probability), *item.alternatives]
    assert [t for t, _ in order] == [term, equal, worse]
    ratios = np.array([p for _, p in order]) / item.probability
    assert ratios == pytest.approx([1.0, np.exp(-0.1), np.exp(-3.0)])
    assert sum(p for _, p in order) == pytest.approx(1.0)
    likelier = Weighed(term, 0.5, ((equal, 0.49),))
    assert with_equals([likelier], term.key, ((equal, -3.0),)) == (likelier,)
    assert with_equals(items, ("inertia", "joint2"), ((equal, -0.1),)) == items
    assert with_equals(items, term.key, ()) == items
