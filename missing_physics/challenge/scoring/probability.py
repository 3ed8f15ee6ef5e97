"""Proper scores of stated probabilities: the logarithmic score and Brier's.

An answer states the probability of each effect at each place; unmentioned ones have probability zero.
Candidates are the effects at places that the answer mentions and those that are hidden. Each is a Bernoulli
trial with the stated probability p and the outcome y, which is 1 if the effect is present:

    log score = sum over candidates of  y log p + (1 - y) log(1 - p)         (at most 0)
    Brier     = sum over candidates of  (p - y)^2                            (at least 0)

(Good, J. R. Stat. Soc. B 14 (1952) 107-114; Brier, Mon. Weather Rev. 78 (1950) 1-3; Gneiting and Raftery,
J. Am. Stat. Assoc. 102 (2007) 359-378.) Candidates that are neither mentioned nor present would add nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import log

__all__ = ["FLOOR", "ProbabilityScore", "probability_score"]

#: Probabilities are limited to this, and to one minus this, in the logarithm: one half of the cases
#: has 150, which cannot distinguish a fraction of 1 % from zero. So an effect that was not mentioned
#: costs 4.6 nats, and certainty gains nothing over 0.99.
FLOOR = 0.01


@dataclass(frozen=True)
class ProbabilityScore:
    """Scores of one answer.

    Attributes:
        log: sum of the logarithms of the probabilities that the answer assigned to the truth [nats].
        brier: sum of squared errors.
        candidates: number of effects at places that were counted.
    """

    log: float
    brier: float
    candidates: int


def probability_score(stated: Mapping[str, float], present: Iterable[str]) -> ProbabilityScore:
    """The scores of `stated` probabilities by label, if the effects `present` are true.

    Args:
        stated: probability of each effect at its place, `ID@PLACE`, that the answer mentions.
        present: labels of the present effects, mentioned or not.
    """
    true = set(present)
    trials = [(stated.get(label, 0.0), label in true) for label in sorted({*stated, *true})]
    return ProbabilityScore(
        log=sum(log(_bounded(p if outcome else 1 - p)) for p, outcome in trials),
        brier=sum((p - outcome) ** 2 for p, outcome in trials),
        candidates=len(trials),
    )


def _bounded(probability: float) -> float:
    return min(max(probability, FLOOR), 1 - FLOOR)
