"""What an exchange of a name for a rival must bring, and what is told of rivals."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from missing_physics.diagnosis.naming import judge
from missing_physics.diagnosis.naming.judge import EXCHANGE, SIMPLER, Weighed, weigh
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect


@dataclass
class Told:
    """An explanation with evidence that is set."""

    found: list[Term]
    evidence: float = 0.0
    terms: list[Term] = field(default_factory=list)

    def evidence_over(self, other: Told) -> float:
        return self.evidence - other.evidence


STRIBECK = {"coulomb_torque": 2.0, "static_torque": 3.0, "stribeck_velocity": 0.1}
RICH = Term(get_effect("stribeck_friction"), "joint1", STRIBECK)
POOR = Term(get_effect("coulomb_friction"), "joint1", {"torque": 2.0})


def chosen(monkeypatch: pytest.MonkeyPatch, own: Term, rival: Term, gain: float) -> Term:
    best, trial = Told([own]), Told([rival], gain)

    def rivals(problem: Any, view: Any, now: Told, term: Term, proof: Any, **other: Any) -> list[Any]:
        return [(best, own, 5.0), (trial, rival, 5.0 + gain)] if now is best else [(trial, rival, 5.0)]

    monkeypatch.setattr(judge, "_rivals", rivals)
    monkeypatch.setattr(judge, "present", lambda trial, term: True)
    none: Any = None
    start: Any = best
    _, [item] = weigh(none, none, start, nuisance=True, progress=lambda phrase: None)
    return item.term


def test_a_rival_with_fewer_numbers_needs_less_to_take_the_place(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(POOR.free) < len(RICH.free)
    between = 0.5 * (SIMPLER + EXCHANGE)
    assert chosen(monkeypatch, RICH, POOR, between) is POOR
    assert chosen(monkeypatch, POOR, RICH, between) is POOR
    assert chosen(monkeypatch, RICH, POOR, 0.5 * SIMPLER) is RICH
    assert chosen(monkeypatch, POOR, RICH, 1.1 * EXCHANGE) is RICH


def test_a_rival_that_runs_ruled_out_is_reported_with_what_they_leave() -> None:
    left = {RICH.key: 0.012, POOR.key: 0.34}
    item = Weighed(RICH, 1.0 - 1e-12, ((POOR, 1e-12),), left)
    why = judge._why_not(item, POOR, 1e-12)
    assert "34 %" in why
    assert "1.2 %" in why
    assert judge._why_not(item, POOR, 0.2) == "cannot be told apart with these data"
    # where the rival runs as well, it was something else that spoke against it
    alike = Weighed(RICH, 0.99, ((POOR, 0.01),), {RICH.key: 0.34, POOR.key: 0.012})
    assert "99 to 1" in judge._why_not(alike, POOR, 0.01)
    assert judge._why_not(Weighed(RICH, 1.0, ()), POOR, 1e-12) == "does not fit the data"
