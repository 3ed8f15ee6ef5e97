"""What gyros say of the bodies, for the estimates from torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.base.stage import BaseResult
from missing_physics.hypotheses import BODIES
from missing_physics.inference.fit import fitted
from missing_physics.standard.layout import Information

__all__ = ["of_bodies"]

Array = NDArray[np.float64]


def of_bodies(base: BaseResult | None) -> Information | None:
    """Information of the gyros about the inertial numbers; None without gyros.

    The rows are those of the most probable hypothesis with all bodies estimated. They are linear about the
    robot file, which errs by about the square of what the bodies change, over the rates' own size.
    """
    if base is None or base.data is None or base.answer is None:
        return None
    data, hypothesis = base.data, base.answer.hypothesis
    is_off = BODIES not in hypothesis.filed
    fit = fitted(data, replace(hypothesis, filed=hypothesis.filed - {BODIES}), base.answer)
    apart = [
        data.designs[run][data.rows_seen(run)] @ (fit.numbers - data.filed) for run in range(data.fitted)
    ]
    bent = np.mean(np.concatenate(apart) ** 2, axis=0) / data.size
    weight = data.independent / (fit.sigma**2 + data.error**2 + bent**2)
    size = len(data.layout.names)
    gram, right = np.zeros((size, size)), np.zeros(size)
    for run in range(data.fitted):
        left = data.target(run) - data.terms.contributed(fit.hypothesis.terms, run)
        rows = data.rows_seen(run)[:, None] & data.counted(run)
        for k, one in enumerate(weight):
            design = data.designs[run][rows[:, k], k]
            gram += one * design.T @ design
            right += one * design.T @ left[rows[:, k], k]
    own = np.arange(data.runs[0].dynamics.model.inertial.size)
    begun = [place for place in range(own.size, size) if data.layout.names[place] not in hypothesis.filed]
    if begun:  # momenta at the start
        taken = np.linalg.lstsq(
            gram[np.ix_(begun, begun)], np.column_stack([gram[begun], right[begun]]), rcond=None
        )
        gram, right = gram - gram[:, begun] @ taken[0][:, :-1], right - gram[:, begun] @ taken[0][:, -1]
    return Information(data.layout.names[: own.size], gram[np.ix_(own, own)], right[own], is_off)
