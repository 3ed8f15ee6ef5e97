"""Numbers and intervals of the final fit."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest
from diagnosis_cases import bare

from missing_physics.diagnosis.naming import final_model as model
from missing_physics.diagnosis.naming.final_model import FinalModel
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect


@pytest.mark.parametrize("by_runs", [False, True], ids=["a regression's", "told by runs"])
def test_a_mass_is_no_surer_than_its_place_lets_it_be(monkeypatch: pytest.MonkeyPatch, by_runs: bool) -> None:
    """What is told is a mass times a lever squared: where the search began it looks well known."""
    load = Term(
        get_effect("payload"),
        "link2",
        {"mass": 10.0, "x": 1.0, "y": 0.0, "z": 0.0},
        unseen=("x", "y", "z"),
        held={"mass": 0.01} if by_runs else {},
    )

    def lever(x: float) -> float:
        return 3.0 + x

    def fitted(problem: object, view: object, terms: list[Term], *, nuisance: bool) -> Any:
        """The regression is half a kilogram off."""
        [term] = terms
        if not term.held:
            mass = 10.5 * lever(1.0) ** 2 / lever(term.parameters["x"]) ** 2
            term = replace(term, parameters={**term.parameters, "mass": mass})
        return explanation_of(term)

    def explanation_of(term: Term) -> Any:
        mass, half = term.parameters["mass"], 0.02 if by_runs else 0.1
        return SimpleNamespace(
            problem=None, view=None, terms=(term,), intervals=lambda _: {"mass": (mass - half, mass + half)}
        )

    monkeypatch.setattr(model, "explain", fitted)
    final = FinalModel.__new__(FinalModel)
    final.robot, final._nuisance = bare("two_link_arm"), False
    final.explanation = final.other = cast(Any, explanation_of(load))
    final._fitted = (final.explanation, final.other)
    mass = final.estimates(load)["mass"]
    step = get_effect("payload").parameter("x").typical
    farther, nearer = (10.5 * lever(1.0) ** 2 / lever(1.0 + by) ** 2 for by in (step, -step))
    assert mass.value == 10.0
    if by_runs:
        assert mass.ci95 == pytest.approx((10.0 - 0.02 + farther - 10.5, 10.0 + 0.02 + nearer - 10.5))
    else:
        assert mass.ci95 == pytest.approx((farther - 0.1, nearer + 0.1))
