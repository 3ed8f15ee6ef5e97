"""Replaces errors and series of a diagnosis by those of three robot files along the recorded motion."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from missing_physics.diagnosis.comparison.predictions import Predictions
from missing_physics.evaluation import Evaluation
from missing_physics.results.comparison import Errors
from missing_physics.results.result import ChannelFit, ChannelSeries, Result

__all__ = ["restated"]


def restated(
    result: Result, nominal: Predictions, answer: Predictions, standard: Predictions | None
) -> Result:
    """`result` with errors and series of these files in the channels that are compared along the motion."""
    before, fit = result.series, result.diagnosis.fit
    series = tuple(_series(before, nominal.made, answer.made))
    along = {one.channel for one in before if one.counted is not None}
    channels = {
        name: _channel(one, name, nominal, answer, standard) if name in along else one
        for name, one in fit.channels.items()
    }
    found, floor = replace(fit, channels=channels), result.rows[0].floor
    if math.isclose(_improvement(before, floor), fit.validation_improvement):
        found = replace(found, validation_improvement=_improvement(series, floor))
    return replace(result, series=series, diagnosis=replace(result.diagnosis, fit=found))


def _channel(
    one: ChannelFit, name: str, nominal: Predictions, answer: Predictions, standard: Predictions | None
) -> ChannelFit:
    if name not in nominal.errors or name not in answer.errors:
        return one
    theirs: Mapping[str, Errors] = {} if standard is None else standard.errors
    return replace(one, before=nominal.errors[name], after=answer.errors[name], standard=theirs.get(name))


def _series(
    series: Sequence[ChannelSeries], nominal: Sequence[Evaluation], answer: Sequence[Evaluation]
) -> Iterator[ChannelSeries]:
    """Series with the predictions of the files; each channel has one series per recording, in order."""
    counts: Counter[str] = Counter()
    for one in series:
        number = counts[one.channel]
        counts[one.channel] += 1
        if one.counted is None or number >= len(answer) or one.channel not in answer[number].channels:
            yield one
        else:
            residuals = [made[number].at(one.time, one.channel) for made in (nominal, answer)]
            yield replace(one, nominal=one.measured - residuals[0], augmented=one.measured - residuals[1])


def _improvement(series: Sequence[ChannelSeries], floor: Mapping[str, float]) -> float:
    """1 - after/before of the held-out error along the motion, in units of the floor of any model."""
    energies = np.zeros(2)
    for one in series:
        if one.counted is None or one.channel not in floor:
            continue
        rows, least = one.held_out & one.counted, max(floor[one.channel], np.finfo(float).eps)
        for k, model in enumerate((one.nominal, one.augmented)):
            energies[k] += float((((one.measured - model)[rows] / least) ** 2).sum())
    return 1.0 - float(np.sqrt(energies[1] / energies[0])) if energies[0] > 0.0 else 0.0
