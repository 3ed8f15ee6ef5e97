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
from reference_model.effects.catalogue import get_effect

__all__ = ["adequacies"]

Array = NDArray[np.float64]

#: Fraction of the explanations with a posterior near one that are right, where joints are explained:
#: (85 + 1) of (94 + 2) in development cases; 30 of 32 in an earlier count (23 of a third engine, nine
#: simulated), 10 of 12 in the half of the simulated yardstick used for development (its page at 782f1f4).
EXPLAINED = 0.89
#: The same elsewhere: 6 of 9 in development cases; 17 of 25 in simulated cases of an earlier program
#: (yardstick_simulated.md at 9fa7b99).
ELSEWHERE = 0.68


def adequacies(data: Data, fit: Fit, standard: Fit | None = None) -> Callable[[str, str], float]:
    """Fraction of right explanations, by effect and place: a joint, its channel, or a body or the base.

    An effect beyond the standard model explains a joint if little remains of the error of that model, any
    other one if little remains of the error of the robot file. A joint with a force without a name is not
    explained; a body and the base are where all joints are.

    Args:
        data: the rows.
        fit: the reported hypothesis.
        standard: the fit of the standard model.
    """
    held_out = ~data.fitted_blocks
    count = np.maximum(data.counts[held_out].sum(axis=0), 1.0)
    after, file = fit.errors[held_out].sum(axis=0) / count, _errors_of_file(data) / count
    least = file if standard is None else np.minimum(file, standard.errors[held_out].sum(axis=0) / count)
    unnamed = {t.at for t in fit.hypothesis.terms if t.effect.is_unknown}
    explained = {
        beyond: {
            j: bool(e) and j not in unnamed for j, e in zip(data.joints, _explained(data, before, after))
        }
        for beyond, before in ((False, file), (True, least))
    }

    def adequacy(effect: str, place: str) -> float:
        found = explained[get_effect(effect).is_beyond_standard]
        return EXPLAINED if found.get(place.split(".")[0], all(found.values())) else ELSEWHERE

    return adequacy


def _explained(data: Data, before: Array, after: Array) -> NDArray[np.bool_]:
    """Whether a mean square is at the noise or small compared with another one, shape (n,)."""
    floor = data.noise**2 + data.error**2
    return np.asarray((after <= AT_NOISE**2 * floor) | (after - floor <= LITTLE * (before - floor)))


def _errors_of_file(data: Data) -> Array:
    """Squared error of the robot file at each joint in held-out blocks, shape (n,)."""
    found = np.zeros(len(data.joints))
    for block in data.blocks:
        if block.fold not in data.folds:
            residual = data.target(block.run)[block.rows] - data.nominal(block.run)[block.rows]
            found += np.sum(residual**2, axis=0)
    return found
