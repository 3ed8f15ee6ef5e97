"""Paired comparison of two versions of the diagnosis ("engines") on the same cases.

Yes/no questions are compared on the cases in which the engines differ: McNemar's exact test, and the
difference of the two fractions with the adjusted interval of Bonett and Price (J. Educ. Behav. Stat. 37
(2012) 479-488). Numbers are compared by the sign test, and the mean difference has an interval from Student's
t distribution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.stats import binomtest, t

from missing_physics.challenge.scoring.result import CaseScore
from missing_physics.challenge.scoring.shares import NORMAL_95
from missing_physics.challenge.scoring.summary import all_identifiable, confidently_wrong, false_alarm
from robot_model import InputError

__all__ = ["NUMBERS", "QUESTIONS", "Comparison", "Difference", "compare", "compare_numbers", "compare_shares"]

#: Yes/no questions, and whether yes is good; None if a question does not apply to a case.
QUESTIONS: Mapping[str, tuple[Callable[[CaseScore], bool | None], bool]] = {
    "place right": (lambda case: case.place, True),
    "name right, identifiable": (lambda case: case.right_name if all_identifiable(case) else None, True),
    "exactly what is hidden, identifiable": (
        lambda case: case.exactly if all_identifiable(case) else None,
        True,
    ),
    "a wrong name stated with more than 0.9": (confidently_wrong, False),
    "something named where the catalogue has nothing": (
        lambda case: None if case.hidden else bool(case.wrong),
        False,
    ),
    "false alarm where nothing is missing": (false_alarm, False),
}
#: Numbers, and whether a larger one is better.
NUMBERS: Mapping[str, tuple[Callable[[CaseScore], float | None], bool]] = {
    "log score [nats]": (lambda case: case.log_score, True),
    "Brier score": (lambda case: case.brier, False),
    "held-out error over the nominal robot's": (lambda case: case.held_out_ratio, False),
    "seconds": (lambda case: case.seconds, False),
}


@dataclass(frozen=True)
class Difference:
    """The second engine minus the first in one measure.

    Attributes:
        name: name of the measure.
        cases: number of cases to which it applies for both.
        first, second: fractions of yes, or means.
        better, worse: cases in which the second engine is better, or worse, than the first.
        p_value: two-sided exact p-value under equal engines.
        difference: second minus first.
        interval: 95 % interval of the difference.
        is_share: `first` and `second` are fractions of yes.
    """

    name: str
    cases: int
    first: float
    second: float
    better: int
    worse: int
    p_value: float
    difference: float
    interval: tuple[float, float]
    is_share: bool = False


@dataclass(frozen=True)
class Comparison:
    """Every measure of two engines on the same cases.

    Attributes:
        cases: number of common cases.
        differences: differences of questions and numbers.
    """

    cases: int
    differences: tuple[Difference, ...]


def compare(first: Sequence[CaseScore], second: Sequence[CaseScore]) -> Comparison:
    """Compare both engines on the common cases; raises `InputError` if there are none, or if they differ."""
    others = {case.number: case for case in second}
    pairs = [(case, others[case.number]) for case in first if case.number in others]
    if not pairs:
        raise InputError("the two engines have no case in common; score both on the same half.")
    for one, other in pairs:
        if (one.name, one.hidden, one.foreign) != (other.name, other.hidden, other.foreign):
            raise InputError(
                f"case {one.number} is not the same in both scores; score both engines on the same cases."
            )
    shares = (compare_shares(name, _both(pairs, ask), good=good) for name, (ask, good) in QUESTIONS.items())
    means = (compare_numbers(name, _both(pairs, of), larger=larger) for name, (of, larger) in NUMBERS.items())
    return Comparison(len(pairs), (*shares, *means))


def _both(
    pairs: Sequence[tuple[CaseScore, CaseScore]], measure: Callable[[CaseScore], float | None]
) -> list[tuple[float, float]]:
    """The measure of both engines in cases to which it applies for both."""
    found = ((measure(one), measure(other)) for one, other in pairs)
    return [(float(one), float(other)) for one, other in found if one is not None and other is not None]


def compare_shares(name: str, pairs: Sequence[tuple[float, float]], *, good: bool = True) -> Difference:
    """McNemar's test of a question; each pair contains 1 for yes and 0 for no."""
    count = len(pairs)
    gained, lost = sum(b > a for a, b in pairs), sum(a > b for a, b in pairs)
    first, second = (_mean([pair[side] for pair in pairs]) for side in (0, 1))
    return Difference(
        name=name,
        cases=count,
        first=first,
        second=second,
        better=gained if good else lost,
        worse=lost if good else gained,
        p_value=_sign_test(gained, lost),
        difference=second - first,
        interval=_bonett_price(gained, lost, count),
        is_share=True,
    )


def _bonett_price(gained: int, lost: int, count: int) -> tuple[float, float]:
    """95 % interval of a difference of paired fractions: one case is added to either kind of discordance."""
    up, down = (gained + 1) / (count + 2), (lost + 1) / (count + 2)
    half = NORMAL_95 * sqrt((up + down - (up - down) ** 2) / (count + 2))
    return max(up - down - half, -1.0), min(up - down + half, 1.0)


def compare_numbers(name: str, pairs: Sequence[tuple[float, float]], *, larger: bool) -> Difference:
    """Sign test and mean difference of a number that is better if `larger`, or else if smaller."""
    changes = np.array([other - one for one, other in pairs])
    up, down = int(np.sum(changes > 0)), int(np.sum(changes < 0))
    mean = _mean(changes.tolist())
    return Difference(
        name=name,
        cases=len(pairs),
        first=_mean([one for one, _ in pairs]),
        second=_mean([other for _, other in pairs]),
        better=up if larger else down,
        worse=down if larger else up,
        p_value=_sign_test(up, down),
        difference=mean,
        interval=_student(changes, mean),
    )


def _student(changes: np.ndarray, mean: float) -> tuple[float, float]:
    """95 % interval of the mean of independent changes; infinite for fewer than two."""
    if len(changes) < 2:
        return -np.inf, np.inf
    half = float(t.ppf(0.975, len(changes) - 1) * changes.std(ddof=1) / sqrt(len(changes)))
    return mean - half, mean + half


def _sign_test(one: int, other: int) -> float:
    """Two-sided p-value of a split of the cases that differ; 1 if none differs."""
    return float(binomtest(one, one + other).pvalue) if one + other else 1.0


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")
