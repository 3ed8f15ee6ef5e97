"""What is missing from links that bend or from a base, named by runs in closed loop.

`passive/naming.py` holds channels against what an estimated motion of the joints makes of base and links: its
errors grow with the motion, and a beam that stiffens, or is damped a little otherwise, does not stand out of
them in fast ones. A run of the whole robot along what was asked of it has no such errors. So candidates are
fitted to the recorded channels by runs, with Gauss-Newton steps in units of the sensors' noise, and one that
brings every channel of fitted and held-out recordings down to the noise is there: nothing else is needed,
and without it, the robot as described did not.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import TOLD
from missing_physics.diagnosis.naming.search import Progress
from missing_physics.diagnosis.passive.naming import Named
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.energies import (
    CONFIRMED,
    DOWN_TO_NOISE,
    INEXACT,
    evidence_for,
    left_in_runs,
    proves,
    runs_of,
)
from missing_physics.diagnosis.runs.fit import RunFit, errors_of, fit_in_runs
from missing_physics.diagnosis.runs.rivals import HEARD
from missing_physics.diagnosis.runs.spreads import spread_of
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.written.augment import uses_of
from missing_physics.results.result import Rung
from robot_model import Robot

__all__ = ["named_in_runs"]

Array = NDArray[np.float64]

#: Part of what differs that may be left where beams may differ otherwise.
LEFT = 0.05


def named_in_runs(
    replay: Replay,
    starts: Iterable[Term],
    progress: Progress,
    rivals: Mapping[str, Sequence[Term]] = MappingProxyType({}),
) -> tuple[Named | None, list[Rung]]:
    """The effect that alone brings every recording down to the noise, and what was tried.

    Args:
        replay: runs along all recordings; those that are not fitted only judge, and nothing is named without.
        starts: candidates, with the numbers from which their fits start; asked for only where runs of the
            robot as described differ from what was recorded.
        rivals: of an effect, by its id, what could be in its place but is not named here.
    """
    before, described = runs_of(replay, replay.robot), errors_of(replay, replay.robot)
    if before is None or described is None or replay.fitted == len(before):
        return None, []
    differing = [float(energies.max()) > HEARD for energies in before]
    if not any(differing[: replay.fitted]) or not any(differing[replay.fitted :]):
        return None, []
    tried = [found for start in starts if (found := _tried(replay, start, described, before, progress))]
    best = max((found for found in tried if found.kept), key=lambda found: found.evidence, default=None)
    if best is None:
        return None, [found.rung for found in tried]
    fit, evidence = best.fit, best.evidence
    (name,) = fit.terms
    others = rivals.get(name.effect.id, ())
    tried += [found for other in others if (found := _tried(replay, other, described, before, progress))]
    proven = [found for found in tried if found.kept and found is not best]
    if any(found.evidence > evidence for found in proven):
        return None, [found.rung for found in tried]
    ladder = [replace(found.rung, kept=found is best) for found in tried]
    robot = _with(replay, fit.terms)
    after = runs_of(replay, robot) or before
    gain = _gain(before[replay.fitted :], after[replay.fitted :])
    same = [found.fit.terms for found in proven]
    runs = [(terms[0], runs_of(replay, _with(replay, terms)) or before) for terms in same]
    alike = tuple((term, evidence - evidence_for(energies, after)) for term, energies in runs)
    unseen = tuple(number for number, told in zip(name.free, fit.told) if not told)
    term = replace(name, unseen=(*name.unseen, *unseen))
    whole = proves(replay, robot, before)
    spread = spread_of(replay, fit, partial(_with, replay))
    return Named(term, evidence, 1.0, alike, _intervals(fit, spread), gain, by_runs=True, whole=whole), ladder


@dataclass(frozen=True)
class _Tried:
    """One candidate fitted: evidence for it, whether it alone is enough, and what the ladder says of it."""

    fit: RunFit
    evidence: float
    kept: bool

    @property
    def rung(self) -> Rung:
        (term,) = self.fit.terms
        why = "alone brings every recording down to the noise" if self.kept else "leaves more than noise"
        return Rung(
            effect=term.effect.id,
            location=term.at,
            added_to=(),
            train_rms=float(np.sqrt(np.mean(self.fit.errors**2))),
            validation_rms=float("nan"),
            evidence=self.evidence,
            kept=False,
            why=f"run in closed loop it {why}",
        )


def _tried(
    replay: Replay, start: Term, described: Array, before: Sequence[Array], progress: Progress
) -> _Tried | None:
    """A candidate; None where it cannot be run."""
    progress(f"running {start.effect.id.replace('_', ' ')} at {start.at} in closed loop")
    fit = fit_in_runs(replay, [start], partial(_with, replay), described)
    if fit is None:
        return None
    evidence = 0.5 * (float(described @ described) - fit.energy)
    evidence -= 0.5 * len(start.free) * float(np.log(described.size))
    return _Tried(fit, evidence, evidence > 0 and _enough(replay, fit.terms, before))


def _intervals(fit: RunFit, spread: Array) -> dict[str, tuple[float, float]]:
    """Of 95 %."""
    ends = zip(fit.terms[0].free, fit.values - TOLD * spread, fit.values + TOLD * spread)
    return {name: (float(low), float(high)) for name, low, high in ends}


def _gain(before: Sequence[Array], after: Sequence[Array]) -> float:
    """Part of the errors' energy that went."""
    return 1.0 - sum(float(e.sum()) for e in after) / sum(float(e.sum()) for e in before)


def _enough(replay: Replay, terms: Sequence[Term], before: Sequence[Array]) -> bool:
    """Whether terms bring every recording down to the noise, or to what beams may differ by otherwise.

    Then something has to stand out of that without them, and next to nothing with them; and they have to
    take most of all that differs. Where nothing stands out of it they have to bring it to near the noise.
    """
    robot = _with(replay, terms)
    if proves(replay, robot, before):
        return True
    after = runs_of(replay, robot)
    left = left_in_runs(replay, after, before)
    if after is None or left is None or left > CONFIRMED:
        return False
    limits = [DOWN_TO_NOISE + replay.doubt(which) for which in range(len(before))]
    if not all(bool((energies <= limit).all()) for energies, limit in zip(after, limits)):
        return False
    beside = left_in_runs(replay, after, before, lenient=True)
    if beside is None:
        return left <= LEFT and max(float(energies.max()) for energies in after) <= DOWN_TO_NOISE + INEXACT
    return beside <= LEFT


def _with(replay: Replay, terms: Sequence[Term]) -> Robot:
    """The described robot with some terms."""
    return replay.robot.with_effects(*uses_of(terms))
