"""Frequency with which an explanation with a posterior near one is right.

The posterior is relative to the hypotheses considered. Whether one of them is right is another question, and
depends on the residual of the best one: if it is no larger than the noise, little remains that another
hypothesis could explain.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from missing_physics.inference import Data, Fit
from missing_physics.results.comparison import AT_NOISE, LITTLE

__all__ = ["adequacies"]

#: Fraction of the explanations with a posterior near one that are right, where joints are explained:
#: (40 + 1) of (44 + 2). 30 of 32 were right in an earlier count (23 of a third engine, nine simulated), 10 of
#: 12 in the half of the simulated yardstick used for development (its page at 782f1f4); some of the nine may
#: be counted twice.
EXPLAINED = 0.89
#: The same elsewhere: 17 of 25 in simulated cases of an earlier program (yardstick_simulated.md at 9fa7b99).
ELSEWHERE = 0.68


def adequacies(data: Data, fit: Fit) -> Callable[[str], float]:
    """Fraction of right explanations at a place: a joint, its channel, or a body, which affects all joints.

    A joint with an unnamed force counts as not explained.

    Args:
        data: the rows.
        fit: the reported hypothesis.
    """
    explained = dict(zip(data.joints, _explained(data, fit)))
    explained |= {t.at: np.False_ for t in fit.hypothesis.terms if t.effect.is_unknown}

    def adequacy(place: str) -> float:
        joint = place.split(".")[0]
        return EXPLAINED if explained.get(joint, all(explained.values())) else ELSEWHERE

    return adequacy


def _explained(data: Data, fit: Fit) -> NDArray[np.bool_]:
    """Whether the held-out residual is at the noise or small compared with the mismatch, shape (n,)."""
    held_out = ~data.fitted_blocks
    count = np.maximum(data.counts[held_out].sum(axis=0), 1.0)
    after = fit.errors[held_out].sum(axis=0) / count
    before = np.zeros_like(after)
    for block in data.blocks:
        if block.fold not in data.folds:
            residual = data.target(block.run)[block.rows] - data.nominal(block.run)[block.rows]
            before += np.sum(residual**2, axis=0) / count
    floor = data.noise**2 + data.error**2
    return np.asarray((after <= AT_NOISE**2 * floor) | (after - floor <= LITTLE * (before - floor)))
