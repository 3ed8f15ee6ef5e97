"""Errors as they are stated: those of the robot file that is written, evaluated apart from every fit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import View, explain
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.preparation.setup import (
    InertialBasis,
    build_problem,
    make_segments,
    nominal_terms,
)
from missing_physics.evaluation import Band, Evaluation, evaluate
from missing_physics.results.result import ChannelFit, ChannelSeries, Errors, Fit
from robot_model import InputError, Recording, Robot

__all__ = ["restated", "stated"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Two improvements are the same but for rounding.
SAME = 1e-9
TINY = 1e-300


#: Recordings that are fitted, those that are held out, and the motions of all in that order.
Recorded = tuple[Sequence[Recording], Sequence[Recording], Sequence[Segment]]


def stated(
    robot: Robot, recorded: Recorded, fit: Fit, series: Sequence[ChannelSeries], *, otherwise: bool = False
) -> tuple[Fit, tuple[ChannelSeries, ...]]:
    """Errors after, and the series of what is predicted, as those of `robot` along the recorded motions.

    Where links bend, the noise of encoders would shake them, so that what is predicted there is smoothed as
    the fit's was.

    Args:
        robot: as the robot file has it.
        recorded: the recordings.
        fit: errors as a fit has them.
        series: the channels that it was compared by; those of runs in closed loop stay as they are.
        otherwise: whether `robot` is known to predict otherwise than the fit.

    Returns:
        `fit` and `series` as they are where `robot` cannot be held against the recordings.
    """
    fitted, others, segments = recorded
    recordings, bands = (*fitted, *others), _bands(segments)
    try:
        if _follows(segments):
            return restated(robot, recordings, replace(fit, bands=bands), series)
        if not otherwise:
            return fit, tuple(series)
        return _with([*_smoothed(robot, recordings, segments)], fit, series)
    except InputError:
        return fit, tuple(series)


def restated(
    robot: Robot, recordings: Sequence[Recording], fit: Fit, series: Sequence[ChannelSeries]
) -> tuple[Fit, tuple[ChannelSeries, ...]]:
    """The same for `recordings` in the order of `fit.bands`.

    Raises:
        InputError: `robot` cannot be held against the recordings.
    """
    made = [evaluate(robot, recording, band) for recording, band in zip(recordings, fit.bands)]
    return _with(made, fit, series)


def _with(
    made: Sequence[Evaluation], fit: Fit, series: Sequence[ChannelSeries]
) -> tuple[Fit, tuple[ChannelSeries, ...]]:
    """Errors and series as those of evaluations, of which each recording has one."""
    told = tuple(_restated(series, made))
    channels = {name: _channel(before, name, told) for name, before in fit.channels.items()}
    found = replace(fit, channels=channels)
    if abs(_improvement(series, fit) - fit.validation_improvement) < SAME:
        found = replace(found, validation_improvement=_improvement(told, found))
    return found, told


def _smoothed(
    robot: Robot, recordings: Sequence[Recording], segments: Sequence[Segment]
) -> Iterator[Evaluation]:
    """What a robot says of recordings with the motion of its links smoothed, as a diagnosis of it would."""
    cutoff, nothing = segments[0].motion.low_pass.cutoff, np.zeros((0, 0))
    terms = [replace(term, frozen=True) for term in nominal_terms(robot)]
    basis = InertialBasis((), np.zeros(0, dtype=int), nothing, np.zeros(0))
    for segment, band in zip(make_segments(robot, recordings, cutoff=cutoff), _bands(segments)):
        problem = build_problem([segment], basis)
        every = View(np.ones(len(problem.outputs)), np.ones(problem.time.size, dtype=bool))
        left = explain(problem, every, terms, nuisance=False).residual
        channels = tuple(output.channel for output in problem.outputs)
        units = ("",) * len(channels)
        yield Evaluation(channels, units, problem.time, problem.measured, problem.measured - left, band)


def _bands(segments: Sequence[Segment]) -> tuple[Band, ...]:
    motions = [segment.motion for segment in segments]
    return tuple(Band(motion.low_pass.cutoff, motion.motion_cutoff) for motion in motions)


def _follows(segments: Sequence[Segment]) -> bool:
    """Whether torques follow from the joints' recorded motion alone.

    Not where links bend, which the noise of encoders would shake, nor where a joint has no encoder.
    """
    return all(segment.vibration is None and not segment.motion.derived for segment in segments)


def _restated(series: Sequence[ChannelSeries], made: Sequence[Evaluation]) -> Iterator[ChannelSeries]:
    """Series with what the evaluations predict; of each channel one comes for every recording, in order."""
    seen: Counter[str] = Counter()
    for one in series:
        number = seen[one.channel]
        seen[one.channel] += 1
        if one.counted is None or number >= len(made) or not _covers(made[number], one):
            yield one
        else:
            left = made[number].at(one.time, one.channel)
            yield replace(one, augmented=one.measured - left)


def _covers(evaluation: Evaluation, series: ChannelSeries) -> bool:
    """Whether it has the channel at all instants, and knows what was measured."""
    if series.channel not in evaluation.channels:
        return False
    first, last = evaluation.time[0], evaluation.time[-1]
    step = (last - first) / max(evaluation.time.size - 1, 1)
    inside = first - step <= series.time[0] and series.time[-1] <= last + step
    return inside and bool(np.isfinite(evaluation.at(series.time, series.channel)).all())


def _channel(before: ChannelFit, name: str, told: Sequence[ChannelSeries]) -> ChannelFit:
    """Errors of a channel after, from its series where it was compared along the motion."""
    own = [one for one in told if one.channel == name and one.counted is not None]
    if not own:
        return before
    left = [one.measured - one.augmented for one in own]
    after = _errors(left, [(one.held_out, _counted(one)) for one in own])
    relative = before.relative_error_after
    if relative is not None:
        every = [(one.held_out, np.ones_like(one.held_out)) for one in own]
        all_of_it, levels = _errors(left, every), _errors([one.measured for one in own], every)
        relative = Errors(
            all_of_it.train_rms / max(levels.train_rms, TINY),
            all_of_it.validation_rms / max(levels.validation_rms, TINY),
        )
    return replace(before, after=after, relative_error_after=relative)


def _errors(values: Sequence[Array], rows: Sequence[tuple[Mask, Mask]]) -> Errors:
    """rms of what was fitted and of what was held out, of the rows that count."""
    fitted = np.concatenate([v[~held & counted] for v, (held, counted) in zip(values, rows)])
    unseen = np.concatenate([v[held & counted] for v, (held, counted) in zip(values, rows)])
    return Errors(_rms(fitted), _rms(unseen))


def _improvement(series: Sequence[ChannelSeries], fit: Fit) -> float:
    """1 - after/before of the whitened held-out error along the motion."""
    energies = np.zeros(2)
    for one in series:
        if one.counted is None or one.channel not in fit.channels:
            continue
        rows, floor = one.held_out & one.counted, max(fit.channels[one.channel].noise_floor, TINY)
        for k, model in enumerate((one.nominal, one.augmented)):
            energies[k] += float((((one.measured - model)[rows] / floor) ** 2).sum())
    return 1.0 - float(np.sqrt(energies[1] / max(energies[0], TINY)))


def _counted(one: ChannelSeries) -> Mask:
    return np.ones_like(one.held_out) if one.counted is None else one.counted


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
