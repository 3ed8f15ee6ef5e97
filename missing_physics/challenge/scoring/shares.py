"""Fractions with their intervals, distances of calibration, and goals for both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

__all__ = ["FEW", "NEAR", "Gap", "Goal", "Share", "Tenth", "wilson", "within"]

#: Quantile of the standard normal for 95 % intervals.
NORMAL_95 = 1.959964
#: Minimum number of findings for a decile of stated probability to count.
FEW = 10
#: Largest acceptable distance of stated probabilities from the right fraction.
NEAR = 0.05


@dataclass(frozen=True)
class Share:
    """A fraction with its counts."""

    hits: int
    count: int

    @property
    def value(self) -> float:
        return self.hits / self.count if self.count else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        return wilson(self.hits, self.count)


#: Bounds of a decile of stated probability, its mean stated probability, and its right fraction.
Tenth = tuple[float, float, float, Share]


@dataclass(frozen=True)
class Gap:
    """The largest distance of stated probabilities from the right fraction.

    Attributes:
        tenths: deciles with at least `FEW` findings.
    """

    tenths: tuple[Tenth, ...]

    @classmethod
    def of(cls, tenths: Sequence[Tenth]) -> Gap:
        """From all deciles with enough findings."""
        return cls(tuple(tenth for tenth in tenths if tenth[3].count >= FEW))

    @property
    def worst(self) -> Tenth | None:
        """The decile with the largest distance."""
        return max(self.tenths, key=lambda tenth: abs(tenth[2] - tenth[3].value), default=None)

    @property
    def value(self) -> float:
        return abs(self.worst[2] - self.worst[3].value) if self.worst else float("nan")

    @property
    def count(self) -> int:
        return len(self.tenths)


def within(tenth: Tenth, near: float = NEAR) -> bool | None:
    """Whether a decile is within `near` according to Wilson's interval; None if this is undecided."""
    (low, high), mean = tenth[3].interval, tenth[2]
    if mean - near <= low and high <= mean + near:
        return True
    return False if high < mean - near or low > mean + near else None


@dataclass(frozen=True)
class Goal:
    """One measure and its goal, bounded by `most` and `least`. Without bounds it has no goal."""

    name: str
    share: Share | Gap
    least: float = 0.0
    most: float = 1.0

    @property
    def verdict(self) -> str:
        """Whether the measured value reaches the goal, and whether the number of cases proves it."""
        if not self.share.count:
            return "no case"
        if not self.bounded:
            return ""
        hit = self.least <= self.share.value <= self.most
        return ("reached" if hit else "missed") + ("" if self._sure(hit) else ", not proven by so many cases")

    @property
    def bounded(self) -> bool:
        """Whether it has a goal."""
        return self.least > 0 or self.most < 1

    def _sure(self, hit: bool) -> bool:
        if isinstance(self.share, Gap):
            decided = [within(tenth, self.most) for tenth in self.share.tenths]
            return all(decided) if hit else False in decided
        low, high = self.share.interval
        return self.least <= low and high <= self.most if hit else high < self.least or low > self.most


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % interval of a fraction (Wilson, J. Am. Stat. Assoc. 22 (1927) 209-212)."""
    if count == 0:
        return 0.0, 1.0
    share, square = hits / count, NORMAL_95**2
    centre = (share + square / (2 * count)) / (1 + square / count)
    spread = sqrt(share * (1 - share) / count + square / (4 * count**2))
    half = NORMAL_95 / (1 + square / count) * spread
    return max(centre - half, 0.0), min(centre + half, 1.0)
