"""What tests of runs that save and complete names have in common."""

from __future__ import annotations

from typing import Any

import pytest

from missing_physics.diagnosis import one_look
from missing_physics.diagnosis.naming.search import Search
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse

SPRING = EffectUse(effect="cable_spring", at="joint1", stiffness=600.0, torque_at_zero=0.0)


def term_of(use: EffectUse, factor: float = 1.0) -> Term:
    return Term(get_effect(use.effect), use.at, {k: factor * v for k, v in use.parameters.items()})


def deafened(monkeypatch: pytest.MonkeyPatch) -> None:
    """Torques along the motion show nothing, and tell of nothing."""

    def unnamed(problem: Any, view: Any, terms: Any, **_: Any) -> Search:
        start = one_look.explain(problem, view, terms, nuisance=False)
        return Search(start, start)

    monkeypatch.setattr(one_look, "locate", lambda *_: ())
    monkeypatch.setattr(one_look, "name_effects", unnamed)
