"""Numbers of cases, and the purpose of each range."""

from __future__ import annotations

from typing import Literal, get_args

__all__ = [
    "DEVELOPMENT_SEEDS",
    "FIRST_SCORING_SEED",
    "HALVES",
    "SCORED",
    "YARDSTICK_SEEDS",
    "Half",
    "half_of",
    "is_kept_for_scoring",
]

#: A case is drawn from its number alone. Numbers for development, which may be inspected at any time;
DEVELOPMENT_SEEDS = range(10000, 20000)
#: numbers of the yardstick, on which two versions of the diagnosis are compared, see `half_of`;
YARDSTICK_SEEDS = range(50000, 50300)
#: and the first of those for scoring, which are not inspected before the score counts.
FIRST_SCORING_SEED = 20000
#: Numbers used up by a score, since its page shows them, with its date; the next score uses others.
#: 28000 to 28204 were inspected without a score. Up to 41204 cases were of the first version of the draws.
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
    (range(42000, 42200), "2026-11-28"),  # the first of the second version
    (range(42200, 42400), "2026-11-29"),
)

#: Halves of the yardstick's numbers: cases of one half may be inspected; those of the other are only counted,
#: so that they show whether an improvement on the former generalises.
Half = Literal["looked", "counted"]
HALVES: tuple[Half, ...] = get_args(Half)


def half_of(number: int) -> Half:
    """The half that a number of the yardstick belongs to: even numbers may be inspected."""
    return HALVES[number % 2]


def is_kept_for_scoring(number: int) -> bool:
    """Whether a case of that number is reserved for scoring."""
    return number >= FIRST_SCORING_SEED and number not in YARDSTICK_SEEDS
