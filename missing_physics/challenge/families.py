"""The ways in which physics hides, and how often each is drawn."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

__all__ = [
    "DEVELOPMENT_SEEDS",
    "FAMILIES",
    "FIRST_SCORING_SEED",
    "MEANING",
    "SCORED",
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

#: A case is drawn from its number alone. Numbers for development, which anybody may look at while working:
DEVELOPMENT_SEEDS = range(10000, 20000)
#: and the first of those for scoring, which nobody looks at before the score is to count.
FIRST_SCORING_SEED = 20000
#: Numbers that a score has used up, since its page shows them, with its day; the next score takes others.
#: 28000 to 28204 were looked at without a score (docs/challenge_history.md).
SCORED: tuple[tuple[range, str], ...] = (
    (range(20000, 20040), "2026-11-21"),
    (range(21000, 21200), "2026-11-21"),
    (range(22000, 22200), "2026-11-22"),
    (range(23000, 23200), "2026-11-22"),
    (range(24000, 24200), "2026-11-22"),
    (range(25000, 25200), "2026-11-23"),
    (range(26000, 26200), "2026-11-23"),
    (range(27000, 27205), "2026-11-23"),
    (range(29000, 29205), "2026-11-25"),
    (range(41000, 41205), "2026-11-25"),
)

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

#: Families in which there is nothing to be named.
NAMELESS: tuple[Family, ...] = ("none", "foreign")


def family_of(number: int) -> Family:
    """The family of a case: every block of 25 consecutive numbers holds the deck once, shuffled."""
    block, place = divmod(number, len(DECK))
    order = np.random.default_rng([block, 7]).permutation(len(DECK))
    return DECK[int(order[place])]


def as_often_as(marked: Family, family: Family, share: float) -> float:
    """How often a case of `family` is given what every case of the family `marked` has.

    `share` of those in which something is hidden; of those with nothing to be named so many that what is
    given is no more frequent among the former.
    """
    if family == marked:
        return 1.0
    if family not in NAMELESS:
        return share
    hiding = sum(other not in NAMELESS for other in DECK)
    own = DECK.count(marked)
    return (own + share * (hiding - own)) / hiding
