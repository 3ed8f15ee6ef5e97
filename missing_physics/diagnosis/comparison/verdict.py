"""The verdict, of what was named, what is left on held-out data and how others do there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from missing_physics.results.comparison import AT_NOISE, LITTLE
from missing_physics.results.result import Finding, Unnamed, Verdict

__all__ = ["LARGER_PART", "Held", "Search", "decided", "energies"]

#: Part that has to be gone before names that cannot be told apart, or have no standard model to be better
#: than, count for more than a guess: what is named is then the larger part of it.
LARGER_PART = 0.5


@dataclass(frozen=True)
class Held:
    """Errors of one channel on data that were not fitted: rms, in any one unit.

    `standard` is None where there is no standard model of the channel.
    """

    nominal: float
    standard: float | None
    answer: float
    noise: float


@dataclass(frozen=True)
class Search:
    """What else the weighing of hypotheses says.

    Attributes:
        verdict: before errors are compared; `consistent` and `not_enough_data` leave nothing to decide.
        worse: whether the answer predicts worse than the standard model or the robot as described.
        mixed: whether the standard model predicts some joints better than what was named there.
        renumbered: whether only numbers of the robot file account for what is gone.
        explained: part of the mismatch energy that is gone.
    """

    verdict: Verdict
    worse: bool = False
    mixed: bool = False
    renumbered: bool = False
    explained: float = 0.0


def decided(
    errors: Sequence[Held], findings: Sequence[Finding], unnamed: Sequence[Unnamed], search: Search
) -> Verdict:
    """The verdict.

    Args:
        errors: of the channels that are compared.
        findings: what was named and proven.
        unnamed: further structure that was found.
        search: what else is known.
    """
    if search.verdict in ("consistent", "not_enough_data"):
        return search.verdict
    if not (findings or search.renumbered) or search.worse:
        return "unexplained"
    whole = _at_noise(errors) or (_little(errors) and not unnamed)
    if any(finding.ambiguous_with for finding in findings):
        return "ambiguous" if whole or search.explained >= LARGER_PART else "unexplained"
    if whole and not search.mixed:
        return "explained"
    return "partly_explained" if _better(errors, search.explained) else "unexplained"


def energies(errors: Sequence[Held]) -> tuple[float, float]:
    """Held-out energy beyond the noise before and after, in units of the noise."""
    before, after = (
        sum(_beyond(rms, held.noise) for rms, held in zip(column, errors))
        for column in ([held.nominal for held in errors], [held.answer for held in errors])
    )
    return before, after


def _beyond(rms: float, noise: float) -> float:
    """Energy beyond the noise, in units of it."""
    return max((rms / max(noise, np.finfo(float).eps)) ** 2 - 1.0, 0.0)


def _at_noise(errors: Sequence[Held]) -> bool:
    return bool(errors) and all(held.answer <= AT_NOISE * held.noise for held in errors)


def _little(errors: Sequence[Held]) -> bool:
    """Whether every channel is at the noise, or little of its own mismatch is left."""
    return bool(errors) and all(
        held.answer <= AT_NOISE * held.noise
        or _beyond(held.answer, held.noise) <= LITTLE * _beyond(held.nominal, held.noise)
        for held in errors
    )


def _better(errors: Sequence[Held], explained: float) -> bool:
    """Whether the answer beats the standard model; without one, whether it explains the larger part."""
    rivals = [(held.answer, held.standard, held.noise) for held in errors if held.standard is not None]
    if not rivals:
        return explained >= LARGER_PART
    levels = [max(standard, noise, np.finfo(float).eps) for _, standard, noise in rivals]
    ours = sum((answer / level) ** 2 for (answer, _, _), level in zip(rivals, levels))
    theirs = sum((standard / level) ** 2 for (_, standard, _), level in zip(rivals, levels))
    return ours < theirs
