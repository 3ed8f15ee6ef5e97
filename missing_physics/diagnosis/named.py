"""What one look has named so far, and what has become of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.naming.judge import Weighed
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.unnamed.adequacy import Accounts

__all__ = ["Named"]


@dataclass
class Named:
    """What is named so far.

    Attributes:
        best: the explanation.
        free: whether the robot's inertial numbers are estimated with it.
        weighed, gains, accounts: of its names.
        before: what the robot as described leaves at each joint of held-out data.
        refused, needless: names that went, and why.
        by_runs: whether runs in closed loop prove the names.
        beaten: names that runs refuse with the best numbers that they can have.
        beside: names that were there meanwhile: of rivals in their place that says nothing.
    """

    best: Explanation
    free: bool
    weighed: tuple[Weighed, ...]
    gains: dict[tuple[str, str], float]
    before: dict[int, float]
    accounts: Accounts = field(default_factory=lambda: Accounts({}, {}))
    refused: tuple[tuple[Term, str], ...] = ()
    needless: tuple[tuple[Term, str], ...] = ()
    by_runs: bool = False
    beaten: frozenset[tuple[str, str]] = frozenset()
    beside: frozenset[tuple[str, str]] = frozenset()

    def renumber(self, best: Explanation) -> None:
        """The same names with other numbers."""
        terms = {term.key: term for term in best.found}
        self.best, self.free = best, self.free and best.nuisance.size > 0
        self.weighed = tuple(replace(w, term=terms.get(w.term.key, w.term)) for w in self.weighed)
