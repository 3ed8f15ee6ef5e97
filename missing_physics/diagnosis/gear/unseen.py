"""What scored recordings say against names of the fit: they may hold motions that no fit has seen.

Play shows where the torque of a gear changes its sign. Where it does so in the scored recording only, the fit
sees a spring, and perhaps reads something else into what is left at the level of noise; the scored error is
then far above the fitted one. Nothing is named by such data, which would prove it by themselves. But a name
that they contradict is taken back, and what explains all recordings together is stated beside the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from missing_physics.diagnosis.gear.causes import Cause
from missing_physics.diagnosis.gear.fit import GapData, GapFit, fit_gap
from missing_physics.diagnosis.gear.search import ODDS, clashes

__all__ = ["contradicted", "of_all_recordings"]

#: A scored error so many times the fitted one, and the noise, is not that of the fit's physics alone.
FAR = 2.0


def of_all_recordings(data: GapData, fit: GapFit) -> GapData | None:
    """The same gaps with every row fitted, where `fit` fails on the scored ones; else None."""
    if fit.rms(data.scored) < FAR * max(fit.rms(data.fitted), data.noise_floor):
        return None
    whole = copy(data)
    whole.fitted = np.ones_like(data.fitted)
    whole.scored = whole.fitted
    return whole


def contradicted(
    data: GapData, whole: GapData, fit: GapFit, causes: Sequence[Cause]
) -> tuple[GapFit, list[tuple[Cause, str]]]:
    """`fit` without causes in whose place another one explains all recordings together better.

    Args:
        data: what was fitted.
        whole: of `of_all_recordings`.
        fit: of `data`.
        causes: all shapes.

    Returns:
        The fit of `data` with the causes that stay, and those that do not, each with the reason.
    """
    needed = float(np.log(ODDS * len({cause.key for cause in causes})))
    dropped: list[tuple[Cause, str]] = []
    while True:
        doubts = [(*_rival(whole, fit, cause, causes), cause) for cause in fit.causes]
        evidence, rival, cause = max(doubts, key=lambda item: item[0], default=(-np.inf, None, None))
        if cause is None or rival is None or evidence < needed:
            return fit, dropped
        why = (
            f"the validation recordings contradict it: with them {rival.effect} at {rival.location} explains "
            f"more (evidence {evidence:.1f}), but the fitted recordings do not hold enough to name that"
        )
        dropped.append((cause, why))
        fit = fit_gap(data, [other for other in fit.causes if other.key != cause.key])


def _rival(whole: GapData, fit: GapFit, cause: Cause, causes: Sequence[Cause]) -> tuple[float, Cause | None]:
    """The best other cause in the place of one, over all recordings, and its evidence over that one.

    None where the one is wanted beside the other too.
    """
    rest = [other for other in fit.causes if other.key != cause.key]
    taken = [other.key for other in rest]
    here = fit_gap(whole, fit.causes)
    best: tuple[float, Cause | None] = -np.inf, None
    for shape in causes:
        if shape.key in (*taken, cause.key) or clashes(shape, taken):
            continue
        trial = fit_gap(whole, [*rest, shape])
        evidence = trial.evidence_over(here)
        if trial.admissible and evidence > best[0]:
            best = evidence, shape
    if best[1] is None or clashes(cause, [best[1].key]):
        return best
    alone = fit_gap(whole, [*rest, best[1]])
    superfluous = fit_gap(whole, [*rest, best[1], cause]).evidence_over(alone) < np.log(ODDS)
    return best if superfluous else (-np.inf, None)
