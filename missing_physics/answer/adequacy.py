"""How often an explanation is right whose posterior is near one.

The posterior is relative to the weighed hypotheses. Whether one of them is right is another question, and
depends on the residual of the best one: where it is no larger than the noise, nothing remains that another
hypothesis could explain. A residual above the noise has structure, however small it is beside the mismatch:
of friction that grows while a joint rests, LuGre friction leaves 2 % of the energy, at seven times the noise.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from missing_physics.inference import Data, Fit
from missing_physics.results.comparison import AT_NOISE

__all__ = ["adequacies"]

#: Part of the explanations with a posterior near one that are right, where no more than noise is left:
#: (40 + 1) of (43 + 2), of 43 findings in development cases (23 of a third engine, 20 simulated).
QUIET = 0.91
#: and elsewhere: 17 of 25 in simulated cases of an earlier program (yardstick_simulated.md at 9fa7b99).
ELSEWHERE = 0.68


def adequacies(data: Data, fit: Fit) -> Callable[[str], float]:
    """Share of right explanations at a place: a joint, its channel, or a body, which affects all joints.

    Args:
        data: the rows.
        fit: the stated hypothesis.
    """
    quiet = dict(zip(data.joints, _is_quiet(data, fit)))

    def adequacy(place: str) -> float:
        joint = place.split(".")[0]
        return QUIET if quiet.get(joint, all(quiet.values())) else ELSEWHERE

    return adequacy


def _is_quiet(data: Data, fit: Fit) -> NDArray[np.bool_]:
    """Whether the held-out residual is at the noise, with the error of any model, shape (n,)."""
    unseen = ~data.seen
    count = np.maximum(data.counts[unseen].sum(axis=0), 1.0)
    after = fit.errors[unseen].sum(axis=0) / count
    noise = np.mean([run.rows.noise**2 for run in data.runs], axis=0)
    return np.asarray(after <= AT_NOISE**2 * (noise + data.error**2))
