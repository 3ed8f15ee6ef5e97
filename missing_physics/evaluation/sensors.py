"""The true values of a channel, corrected for a known sensor error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reference_model.effects.base import SensorEffect
from reference_model.effects.catalogue import UsedEffect

__all__ = ["without_error"]

Array = NDArray[np.float64]

#: Rounds of successive substitution. The first guess applies the opposite error; each round then reduces the
#: remaining error by the ratio of sensor error to value.
ROUNDS = 2
#: Largest delay of a sensor [s].
LONGEST_DELAY = 0.5


def without_error(time: Array, measured: Array, used: UsedEffect) -> Array:
    """The true values that a sensor's error maps to the measured ones, by successive substitution.

    Args:
        time: instants [s], shape (N,), evenly spaced.
        measured: values at these instants, shape (N,).
        used: the error, a `SensorEffect`.
    """
    effect = used.effect
    assert isinstance(effect, SensorEffect)
    values, step = dict(used.parameters), float(time[1] - time[0])
    added = min(time.size - 1, int(LONGEST_DELAY / step))
    margin = step * np.arange(1, added + 1)
    instants = np.concatenate([time[0] - margin[::-1], time, time[-1] + margin])
    padded = np.pad(measured, added, mode="reflect", reflect_type="odd")  # keeps value and slope at its ends
    true = effect.apply(instants, padded, {name: -value for name, value in values.items()})
    for _ in range(ROUNDS):
        true = true + padded - effect.apply(instants, true, values)
    return np.asarray(true[added : added + time.size])
