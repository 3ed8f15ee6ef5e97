"""The verdict, from the findings and the held-out errors of the answer and of its rivals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from missing_physics.results.comparison import AT_NOISE, LITTLE
from missing_physics.results.result import Finding, Unnamed, Verdict

__all__ = ["LARGER_PART", "Held", "Search", "decided", "energies"]

#: Fraction of the mismatch energy that findings must explain where there is no standard model.
LARGER_PART = 0.5


@dataclass(frozen=True)
class Held:
    """rms errors of one channel on held-out data, all in the same unit.

    Attributes:
        nominal, answer, noise: of the robot file, of the answer, and of the sensors.
        standard: of the standard model; None if there is none of the channel.
        beyond: whether an effect that the standard model lacks is named at its joint.
    """

    nominal: float
    standard: float | None
    answer: float
    noise: float
    beyond: bool = False

    @property
    def before(self) -> float:
        """Error that the findings are to explain."""
        if self.standard is None or not self.beyond:
            return self.nominal
        return min(self.nominal, self.standard)


@dataclass(frozen=True)
class Search:
    """Further results of the inference.

    Attributes:
        verdict: preliminary verdict; `consistent` and `not_enough_data` are final.
        worse: whether the answer predicts worse than the standard model or the nominal robot.
        mixed: whether the standard model predicts some joints better than the findings there.
        renumbered: whether changed parameters of the robot file alone explain the mismatch.
        explained: fraction of the mismatch energy that is explained.
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
        errors: of the compared channels.
        findings: confirmed findings.
        unnamed: further structure that was found.
        search: further results of the inference.
    """
    if search.verdict in ("consistent", "not_enough_data"):
        return search.verdict
    if not (findings or search.renumbered) or search.worse:
        return "unexplained"
    complete = _at_noise(errors) or (_little_remains(errors) and not unnamed)
    if complete and any(finding.ambiguous_with for finding in findings):
        return "ambiguous"
    if complete and not search.mixed:
        return "explained"
    return "partly_explained" if _beats_standard(errors, search.explained) else "unexplained"


def energies(errors: Sequence[Held]) -> tuple[float, float]:
    """Held-out error energy beyond the noise of nominal robot and answer, in units of the noise."""
    before, after = (
        sum(_beyond(rms, held.noise) for rms, held in zip(column, errors))
        for column in ([held.nominal for held in errors], [held.answer for held in errors])
    )
    return before, after


def _beyond(rms: float, noise: float) -> float:
    """Error energy beyond the noise, in units of the noise."""
    return max((rms / max(noise, np.finfo(float).eps)) ** 2 - 1.0, 0.0)


def _at_noise(errors: Sequence[Held]) -> bool:
    return bool(errors) and all(held.answer <= AT_NOISE * held.noise for held in errors)


def _little_remains(errors: Sequence[Held]) -> bool:
    """Whether every channel is at the noise, or little of its mismatch remains."""
    return bool(errors) and all(
        held.answer <= AT_NOISE * held.noise
        or _beyond(held.answer, held.noise) <= LITTLE * _beyond(held.before, held.noise)
        for held in errors
    )


def _beats_standard(errors: Sequence[Held], explained: float) -> bool:
    """Whether the answer beats the standard model; without one, whether it explains the larger part."""
    rivals = [(held.answer, held.standard, held.noise) for held in errors if held.standard is not None]
    if not rivals:
        return explained >= LARGER_PART
    levels = [max(standard, noise, np.finfo(float).eps) for _, standard, noise in rivals]
    ours = sum((answer / level) ** 2 for (answer, _, _), level in zip(rivals, levels))
    theirs = sum((standard / level) ** 2 for (_, standard, _), level in zip(rivals, levels))
    return ours < theirs
