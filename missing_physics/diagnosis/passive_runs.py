"""What is missing from links that bend or from a base, named by runs in closed loop.

`passive_naming` holds channels against what an estimated motion of the joints makes of base and links: its
errors grow with the motion, and a beam that stiffens, or is damped a little otherwise, does not stand out of
them in fast ones. A run of the whole robot along what was asked of it has no such errors. So candidates are
fitted to the recorded channels by runs, with Gauss-Newton steps in units of the sensors' noise, and one that
brings every channel of fitted and held-out recordings down to the noise is there: nothing else is needed,
and without it, the robot as described did not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.augment import rounded
from missing_physics.diagnosis.closed_loop import (
    CONFIRMED,
    DOWN_TO_NOISE,
    evidence_for,
    left_in_runs,
    proves,
    runs_of,
)
from missing_physics.diagnosis.naming import Progress
from missing_physics.diagnosis.passive_naming import Named
from missing_physics.diagnosis.replay import Replay
from missing_physics.diagnosis.result import Rung
from missing_physics.diagnosis.run_fit import RunFit, errors_of, fit_in_runs
from missing_physics.diagnosis.run_rivals import HEARD
from missing_physics.diagnosis.terms import Term
from robot_model import EffectUse, Robot

__all__ = ["named_in_runs"]

Array = NDArray[np.float64]

#: Part of what differs that may be left where beams may differ otherwise.
LEFT = 0.05


def named_in_runs(
    replay: Replay, starts: Sequence[Term], progress: Progress
) -> tuple[Named | None, list[Rung]]:
    """The effect that alone brings every recording down to the noise, and what was tried.

    Args:
        replay: runs along all recordings; those that are not fitted only judge, and nothing is named without.
        starts: candidates, with the numbers from which their fits start.
    """
    before, described = runs_of(replay, replay.robot), errors_of(replay, replay.robot)
    if before is None or described is None or replay.fitted == len(before):
        return None, []
    differing = [float(energies.max()) > HEARD for energies in before]
    if not any(differing[: replay.fitted]) or not any(differing[replay.fitted :]):
        return None, []
    proven: list[tuple[RunFit, float]] = []
    ladder = []
    for start in starts:
        progress(f"running {start.effect.id.replace('_', ' ')} at {start.at} in closed loop")
        fit = fit_in_runs(replay, [start], partial(_with, replay), described)
        if fit is None:
            continue
        evidence = 0.5 * (float(described @ described) - fit.energy)
        evidence -= 0.5 * len(start.free) * float(np.log(described.size))
        kept = evidence > 0 and _enough(replay, fit.terms, before)
        if kept:
            proven.append((fit, evidence))
        why = "alone brings every recording down to the noise" if kept else "leaves more than noise"
        ladder.append(
            Rung(
                effect=start.effect.id,
                location=start.at,
                added_to=(),
                train_rms=float(np.sqrt(np.mean(fit.errors**2))),
                validation_rms=float("nan"),
                evidence=evidence,
                kept=False,
                why=f"run in closed loop it {why}",
            )
        )
    if not proven:
        return None, ladder
    fit, evidence = max(proven, key=lambda pair: pair[1])
    (name,) = fit.terms
    ladder = [replace(rung, kept=(rung.effect, rung.location) == name.key) for rung in ladder]
    robot = _with(replay, fit.terms)
    after = runs_of(replay, robot) or before
    gain = _gain(before[replay.fitted :], after[replay.fitted :])
    others = [
        (other.terms, runs_of(replay, _with(replay, other.terms))) for other, _ in proven if other is not fit
    ]
    rivals = tuple((terms[0], evidence - evidence_for(runs or before, after)) for terms, runs in others)
    unseen = tuple(number for number, told in zip(name.free, fit.told) if not told)
    term = replace(name, unseen=(*name.unseen, *unseen))
    whole = proves(replay, robot, before)
    return Named(term, evidence, 1.0, rivals, _intervals(fit), gain, by_runs=True, whole=whole), ladder


def _intervals(fit: RunFit) -> dict[str, tuple[float, float]]:
    """Of 95 %."""
    ends = zip(fit.terms[0].free, fit.values - 1.96 * fit.spread, fit.values + 1.96 * fit.spread)
    return {name: (float(low), float(high)) for name, low, high in ends}


def _gain(before: Sequence[Array], after: Sequence[Array]) -> float:
    """Part of the errors' energy that went."""
    return 1.0 - sum(float(e.sum()) for e in after) / sum(float(e.sum()) for e in before)


def _enough(replay: Replay, terms: Sequence[Term], before: Sequence[Array]) -> bool:
    """Whether terms bring every recording down to the noise, or to what beams may differ by otherwise.

    Then something has to stand out of that without them, and next to nothing with them; and they have to
    take most of all that differs.
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
    left = left_in_runs(replay, after, before, lenient=True)
    return left is not None and left <= LEFT


def _with(replay: Replay, terms: Sequence[Term]) -> Robot:
    """The described robot with some terms."""
    return replay.robot.with_effects(
        *(
            EffectUse(effect=t.effect.id, at=t.at, **{name: rounded(value) for name, value in t.own.items()})
            for t in terms
        )
    )
