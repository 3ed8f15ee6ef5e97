"""Whether what was named accounts for what differs where it acts.

Evidence compares explanations with each other, held-out data with none: physics that is in no catalogue can
make both speak for whatever is nearest to it. It shows in what is left. So each name is held against a rival
without a law (`unnamed/curves.py`): a curve over any coordinate at the joint, fitted beside everything
named, that foretells what is left on data that no fit has seen. Where no curve does, whatever is left has no
shape that another law could have, and the name keeps its probability. Where one does, a name is worth what
it removes by itself beside what the curve foretells; and where next to noise alone is left beside the curve,
another force in the law's place is likelier than a second one beside it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.location.residual import FLOOR_TOLERANCE
from missing_physics.diagnosis.preparation.proof import HeldOut
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.unnamed.bounds import wants_beyond
from missing_physics.diagnosis.unnamed.curves import LawFree, Leftover
from missing_physics.results.result import Finding

__all__ = ["Account", "Accounts", "accounts_of", "adequate", "believed", "left_by", "told_by_torque"]

#: What noise leaves, over its floor, in energy: floors are estimates, and what is fitted has errors, too.
NOISE = 1.5**2
#: A name is half believed where it removes so many times the energy that a clear curve foretells beside it.
HALF_BELIEVED = 3.0
#: Odds of another force to a second one beside the law, where all that is left is one plain curve.
OTHER = 2.0
#: Laws seldom imitate another force closer than by this part of its energy.
IMITATED = 2e-3
#: Odds of physics outside the catalogue, before any data.
FOREIGN = 1.0 / 8.0
#: What is believed less is no name.
LEAST_BELIEF = 0.5


@dataclass(frozen=True)
class Account:
    """Energies at the joints where a term shows, on held-out data, in units of the noise floor's.

    Attributes:
        removed: by the term alone.
        foretold: by curves over what is left, weighed by how clear they are and by how far they can stand in
            for the term, or by the named numbers if they may be others there.
        adequate: whether all that is named removes more at these joints than it leaves beyond noise; of a
            term that held-out data cannot tell, whether the robot as described leaves no less in them.
        beyond: what is left there beyond noise, whatever it is; of such a term in the fitted data.
        other: odds, by what is left being one plain curve, that the force is not the law at all; the mean
            over the joints by what the term removes there.
        visible: least energy that would stand out beside the name.
        end: which number the data want beyond its range; empty where there is none.
    """

    removed: float
    foretold: float
    adequate: bool = True
    beyond: float = 0.0
    other: float = 0.0
    visible: float = 0.0
    end: str = ""

    @property
    def belief(self) -> float:
        """How far the name is believed, 0 to 1."""
        if not self.adequate or self.end:
            return 0.0
        odds = self.other
        if self.foretold > 0:
            odds = max(odds, HALF_BELIEVED * self.foretold / max(self.removed, 1e-300))
        return 1.0 / (1.0 + odds)

    @property
    def weight(self) -> float:
        """By what the name's probability is multiplied.

        No curve may see what is left, but it is there. And where little of what a law imitates would stand
        out, nothing to be seen says little: the name keeps no more than the share of cases in which physics
        is in the catalogue.
        """
        removed = max(self.removed, 0.0)
        closest = np.log(0.5 / IMITATED)
        unseen = np.clip(np.log(self.visible / max(removed * IMITATED, 1e-300) + 1e-300) / closest, 0.0, 1.0)
        share = removed / (removed + self.beyond) if self.beyond > 0 else 1.0
        return float(self.belief * share / (1.0 + FOREIGN * unseen))


Key = tuple[str, str]


@dataclass(frozen=True)
class Accounts:
    """Of every found term, by its key; and what is left at each joint, by its index."""

    terms: Mapping[Key, Account]
    left: Mapping[int, Leftover]


def left_by(explanation: Explanation, held_out: HeldOut) -> dict[int, float]:
    """Mean square that an explanation leaves unseen at each joint, in units of the noise floor's."""
    free = LawFree(explanation, held_out)
    return {k: free.left(k) for k in range(len(explanation.problem.outputs))}


def accounts_of(explanation: Explanation, held_out: HeldOut, before: Mapping[int, float]) -> Accounts:
    """The account of every found term; `before` is what the nominal robot leaves at each joint."""
    problem = explanation.problem
    free = LawFree(explanation, held_out)
    usable = [k for k in range(len(problem.outputs)) if problem.usable[k]]
    named = {k for term in explanation.found for k in _shown(problem, term)}
    left = {
        k: free.leftover(k)
        if problem.outputs[k].joint is not None and (k in named or free.left(k) > NOISE)
        else free.without_curve(k)
        for k in usable
    }
    terms = {}
    for term in explanation.found:
        terms[term.key] = _account(free, term, [left[k] for k in _shown(problem, term) if k in left], before)
    return Accounts(terms, left)


def _shown(problem: Problem, term: Term) -> list[int]:
    """Outputs that a term answers for: its gyro's, its joint's, or all of them for a body or the base."""
    own = [k for k, output in enumerate(problem.outputs) if output.channel == term.at]
    place = term.at.split(".")[0]
    return own or [
        k for k, o in enumerate(problem.outputs) if place not in problem.joints or o.place == place
    ]


def _account(free: LawFree, term: Term, left: Sequence[Leftover], before: Mapping[int, float]) -> Account:
    removed = foretold = other = visible = 0.0
    seen = free.where_fitted(term)
    for item in left:
        alone = free.removed(term, item.joint)
        if not seen:
            alone = min(alone, before[item.joint] - item.left)
        removed += max(alone, 0.0)
        clear = item.foretold(where_fitted=seen)
        if clear > 0 and alone > 0:
            as_well = 1.0
            if item.coordinate is not None:
                as_well = float(np.clip(1.0 - free.removed_beside(term, item) / alone, 0.0, 1.0))
            clear *= as_well
            other += alone * as_well * _other(item, alone)
        foretold += clear
        if alone > 0:
            visible += free.visible(item.joint, seen=seen)
    beyond = sum(max((item.fitted_left if seen else item.left) - NOISE, 0.0) for item in left)
    then = sum(max(before[item.joint], NOISE) for item in left)
    now = sum(max(item.left, NOISE) for item in left)
    fits = now <= FLOOR_TOLERANCE**2 * then if seen else then - now >= beyond
    return Account(
        removed,
        foretold,
        removed > 0 and fits,
        beyond,
        other / max(removed, 1e-300),
        visible,
        wants_beyond(free.explanation, term),
    )


def _other(item: Leftover, removed: float) -> float:
    """Odds that all of the force at a joint is another one, to a second force beside the law.

    Both are there as often as physics that nobody knows, and a second force that nothing names, are. Both
    leave a curve; but another force is seldom imitated so closely that next to nothing is left.
    """
    gained = item.left * min(item.share, 1.0)
    return OTHER * item.plain * gained / max(gained + IMITATED * removed, 1e-300)


def adequate(
    best: Explanation, held_out: HeldOut, *, before: Mapping[int, float], nuisance: bool
) -> tuple[Explanation, Accounts, tuple[tuple[Term, str], ...]]:
    """`best` without names that are believed less than half, the least believed first.

    An effect that the robot file has keeps the number that was found for it, without a name for that.

    Returns:
        What is left of it; its accounts; the terms that went, each with the reason.
    """
    dropped: list[tuple[Term, str]] = []
    while True:
        accounts = accounts_of(best, held_out, before)
        worst = min(best.found, key=lambda term: accounts.terms[term.key].belief, default=None)
        if worst is None or accounts.terms[worst.key].belief >= LEAST_BELIEF:
            return best, accounts, tuple(dropped)
        dropped.append((worst, _words(best, accounts, worst)))
        best = explain(best.problem, best.view, _unnamed(best, worst), nuisance=nuisance)


def _unnamed(best: Explanation, term: Term) -> list[Term]:
    """All terms but `term`, which goes on as a number that is estimated anew where the robot file has it."""
    if term.key not in {(use.effect, use.at) for use in best.problem.robot.effects}:
        return best.terms_without(term)
    return [replace(t, nominal=True) if t.key == term.key else t for t in best.terms]


def _words(explanation: Explanation, accounts: Accounts, term: Term) -> str:
    shown = _shown(explanation.problem, term)
    if end := accounts.terms[term.key].end:
        return f"{end}, so that something else is there"
    items = [item for k, item in accounts.left.items() if k in shown]
    strongest = max(items, key=lambda item: item.foretold(), default=None)
    if strongest is None or not accounts.terms[term.key].adequate:
        return "what is named there removes less than it leaves, so that something else is there"
    if strongest.coordinate is None:
        return (
            f"its numbers fit one part of the data only: others leave {strongest.share:.0%} less in the "
            "held-out part, so that something else is there"
        )
    over = " and ".join(strongest.coordinate.variables)
    return (
        f"a curve without a law over {over} predicts {strongest.share:.0%} of what it leaves in data that "
        "were not fitted, so that something else is there"
    )


def believed(findings: Sequence[Finding], accounts: Accounts) -> tuple[Finding, ...]:
    """Findings as probable as what is left where they act allows."""
    return tuple(_believed(finding, accounts) for finding in findings)


def _believed(finding: Finding, accounts: Accounts) -> Finding:
    account = accounts.terms.get((finding.effect, finding.location))
    if account is None or account.weight == 1.0:
        return finding
    belief = account.weight
    return replace(
        finding,
        probability=finding.probability * belief,
        alternatives=tuple(replace(a, probability=a.probability * belief) for a in finding.alternatives),
    )


def told_by_torque(problem: Problem, accounts: Accounts, emptied: Collection[str]) -> set[str]:
    """Joints where measured torques show something without a name: free runs must not name it.

    Args:
        emptied: joints of which names were refused.
    """
    shown = {k for k, item in accounts.left.items() if item.foretold() > 0}
    return {
        name
        for k, name in enumerate(problem.joints)
        if (k in shown or name in emptied) and all(name in s.motion.torque_sensors for s in problem.segments)
    }
