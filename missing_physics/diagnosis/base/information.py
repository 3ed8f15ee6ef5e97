"""Information on the bodies from gyros, for the estimates from torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.base.stage import BaseResult
from missing_physics.hypotheses import BODIES, Term, prior_of
from missing_physics.inference.fit import fitted
from missing_physics.standard.layout import Information
from reference_model.effects.catalogue import get_effect

__all__ = ["of_bodies"]

Array = NDArray[np.float64]


def of_bodies(base: BaseResult | None) -> Information | None:
    """Information on the inertial parameters from gyros; None without gyros.

    The rows are those of the most probable hypothesis with all bodies estimated, linearised at the robot
    file. The linearisation error is about the square of the bodies' contribution over the rms of the rates.
    Initial momenta, and the scale of every gyro within its credible range, are marginalised.
    """
    if base is None or base.data is None or base.answer is None:
        return None
    data, hypothesis = base.data, base.answer.hypothesis
    is_off = BODIES not in hypothesis.from_file
    fit = fitted(data, replace(hypothesis, from_file=hypothesis.from_file - {BODIES}), base.answer)
    contributions = [
        data.designs[run][data.fitted_rows(run)] @ (fit.parameters - data.file_values)
        for run in range(data.fitted)
    ]
    linearisation = np.mean(np.concatenate(contributions) ** 2, axis=0) / data.size
    weight = np.sqrt(data.independent / (fit.sigma**2 + data.error**2 + linearisation**2))
    scales = [Term.of(get_effect("sensor_gain"), gyro, {"gain_error": 0.0}) for gyro in data.joints]
    rows, targets = [], []
    for run in range(data.fitted):
        fitted_rows = data.fitted_rows(run)[:, None] & data.counted(run)
        columns = [data.designs[run], *(data.columns(term, run)[:, :, 1:] for term in scales)]
        rows.append((np.concatenate(columns, axis=2) * weight[:, None])[fitted_rows])
        own = data.target(run) - data.terms.contributed(fit.hypothesis.terms, run)
        targets.append((own * weight)[fitted_rows])
    design, target = np.concatenate(rows), np.concatenate(targets)
    bodies = np.arange(data.runs[0].dynamics.model.inertial.size)
    names = data.layout.names
    begun = [k for k in range(bodies.size, len(names)) if names[k] not in hypothesis.from_file]
    gains = np.arange(len(names), design.shape[1])
    gram, right = design.T @ design, design.T @ target
    known = [prior_of(term, p) for term in scales for p in term.free]
    gram[gains, gains] += [1.0 / one[1] ** 2 if one else 0.0 for one in known]
    others = np.array([*begun, *gains], dtype=int)
    inner = np.linalg.pinv(gram[np.ix_(others, others)], hermitian=True)
    across = gram[np.ix_(bodies, others)] @ inner
    matrix = gram[np.ix_(bodies, bodies)] - across @ gram[np.ix_(others, bodies)]
    return Information(names[: bodies.size], matrix, right[bodies] - across @ right[others], is_off)
