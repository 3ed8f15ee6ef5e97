"""What a gear that is known to give may have lost besides: play and friction, which give alike.

A gear with backlash or hysteresis gives as a spring does while its torque keeps its sign, or hardly turns.
Then a spring alone says no less, and no more, than a spring with either.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats
from scipy.special import logsumexp

from missing_physics.diagnosis.gear.causes import Cause
from missing_physics.diagnosis.gear.fit import GapData, GapFit, fit_gap
from missing_physics.diagnosis.gear.search import CLASHING

__all__ = ["lost_motion_beside"]


def lost_motion_beside(
    data: GapData, best: GapFit, spring: Cause, causes: Sequence[Cause], whole: GapData | None = None
) -> dict[tuple[str, str], float]:
    """Log of the odds of the gear's spring with play, or with friction inside, against the spring alone.

    Where the torque never changes its sign the play is never crossed: the odds are even. Else the size of
    what is lost, in the gap's unit, has a prior as wide as the gap (rms r, normal), and an estimate c with
    standard error s; the ratio of the two evidences is then

        log odds = c^2 / (2 s^2) - log(1 + r^2 / s^2) / 2

    to first order (Laplace; MacKay, Neural Computation 4 (1992) 415-447), averaged over the shapes. What was
    refused as a finding is at most as probable as what was named.

    Where the scored recordings fail the fit, `whole` are all rows, and the odds are those of fits of all of
    them: the best of the two is as probable as the spring alone, the other as much less as it explains less.

    Returns:
        By (effect, location); empty for other causes than a spring, and where either is named already.
    """
    found = {cause.effect for cause in best.causes if cause.location == spring.location}
    if not spring.meanings[0].inverse or found & CLASHING:
        return {}
    if whole is not None:
        return _by_all_recordings(whole, best, spring, causes)
    width = fit_gap(data, ()).rms(data.fitted)
    quantile = float(stats.norm.ppf(0.975))
    odds = {}
    for effect in sorted(CLASHING):
        shapes = [c for c in causes if c.key == (effect, spring.location) and c.torque is not None]
        logs = []
        for shape in shapes:
            value, half = fit_gap(data, [*best.causes, shape]).values(shape)
            error = max(float(half[0]) / quantile, 1e-300)
            seen = max(float(value[0]), 0.0) / error  # play has a sign
            logs.append(0.5 * seen**2 - 0.5 * np.log1p((width / error) ** 2))
        even = not logs
        odds[effect, spring.location] = 0.0 if even else min(float(logsumexp(logs) - np.log(len(logs))), 0.0)
    return odds


def _by_all_recordings(
    whole: GapData, best: GapFit, spring: Cause, causes: Sequence[Cause]
) -> dict[tuple[str, str], float]:
    alone = fit_gap(whole, best.causes)
    logs = {}
    for effect in sorted(CLASHING):
        key = effect, spring.location
        trials = [fit_gap(whole, [*best.causes, shape]) for shape in causes if shape.key == key]
        logs[key] = max((t.evidence_over(alone) for t in trials if t.admissible), default=-np.inf)
    most = max(0.0, *logs.values())
    return {key: value - most for key, value in logs.items()}
