"""Families of cases: the ways in which physics is hidden, and how often each is drawn."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

__all__ = [
    "FAMILIES",
    "MEANING",
    "Family",
    "as_often_as",
    "family_of",
]

Family = Literal[
    "plain",
    "feedback",
    "tuned_away",
    "compensated",
    "remote",
    "brief",
    "noisy",
    "mixed",
    "none",
    "foreign",
]
FAMILIES: tuple[Family, ...] = get_args(Family)

MEANING: dict[Family, str] = {
    "plain": "simply left out of the nominal robot",
    "feedback": "a stiff controller keeps the positions on the reference; only the torque shows it",
    "tuned_away": "masses and friction of the nominal robot were fitted to this very recording without it",
    "compensated": "the controller's feed-forward cancels most of it",
    "remote": "at a base or in a link that bends, with no sensor there; joints are measured",
    "brief": "it acts in less than a twentieth of the time",
    "noisy": "the torque noise is about as large as what it does",
    "mixed": "two or three effects at once",
    "none": "nothing is missing",
    "foreign": "physics that is not in the catalogue; it must stay unnamed",
}

#: Cases of each family in every block of consecutive numbers.
DECK: tuple[Family, ...] = (
    *(("plain",) * 5),
    *(("feedback",) * 2),
    *(("tuned_away",) * 3),
    *(("compensated",) * 1),
    *(("remote",) * 1),
    *(("brief",) * 2),
    *(("noisy",) * 2),
    *(("mixed",) * 3),
    *(("none",) * 3),
    *(("foreign",) * 3),
)

#: Families without a hidden effect of the catalogue.
NAMELESS: tuple[Family, ...] = ("none", "foreign")


def family_of(number: int) -> Family:
    """The family of a case: every block of 25 consecutive numbers contains the deck once, shuffled."""
    block, place = divmod(number, len(DECK))
    order = np.random.default_rng([block, 7]).permutation(len(DECK))
    return DECK[int(order[place])]


def as_often_as(marked: Family, family: Family, share: float) -> float:
    """Probability that a case of `family` is given a property that every case of the family `marked` has.

    It is `share` if an effect is hidden; without a hidden effect it is such that the property is
    equally frequent with and without hidden effects.
    """
    if family == marked:
        return 1.0
    if family not in NAMELESS:
        return share
    hiding = sum(other not in NAMELESS for other in DECK)
    own = DECK.count(marked)
    return (own + share * (hiding - own)) / hiding
