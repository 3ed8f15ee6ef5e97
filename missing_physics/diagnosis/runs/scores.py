"""Errors of an explanation over what was measured: along the recorded motion, or in closed loop.

A hidden mode of little damping amplifies the noise of the motion that drives it: along a recorded motion the
right mode with its right numbers may be farther off than none. Where runs of the robot with what was named
leave nothing but noise, and torques along the motion more, the errors are those of the runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.energies import left_in_runs, runs_of
from missing_physics.diagnosis.runs.numbers import Run, allowed_in
from missing_physics.diagnosis.runs.torque_scores import TorqueScores
from missing_physics.diagnosis.written.words import down_to_noise
from missing_physics.results.result import ChannelFit, ChannelSeries, Errors, Fit
from robot_model import Robot

__all__ = ["Scored", "scored"]

Array = NDArray[np.float64]

#: Said where the errors are those of runs.
NOTE = (
    "Errors are those of runs in closed loop along the recorded references: torques along the recorded "
    "motion, whose derivatives are noisy, are less accurate."
)


@dataclass(frozen=True)
class Scored:
    """Errors before and after.

    Attributes:
        fit: of each channel.
        explained: part of the held-out mismatch energy that is gone.
        series: what was measured, and what both explanations say.
        by_runs: whether these are errors of runs, which leave nothing but noise.
    """

    fit: Fit
    explained: float
    series: tuple[ChannelSeries, ...]
    by_runs: bool = False

    @property
    def notes(self) -> tuple[str, ...]:
        """What is said of it."""
        return (NOTE,) if self.by_runs else ()


def scored(
    scores: TorqueScores,
    before: Explanation,
    after: Explanation,
    replay: Replay | None,
    robot: Robot | None,
    gone: float,
) -> Scored:
    """Errors of the explanation `before` anything was named, and `after`.

    Args:
        replay: runs along all recordings; None where that is not possible.
        robot: of `after`; None where it is no real one.
        gone: part of the mismatch energy that is gone by what further channels told.
    """
    fit, explained = scores.fit(before, after)
    if gone > 0:  # torques along the motion may not show it
        fit = replace(fit, validation_improvement=1.0 - float(np.sqrt(1.0 - gone)))
        explained = max(explained, gone)
    found = Scored(fit, explained, scores.series(before, after))
    if replay is None or robot is None or not after.found or down_to_noise(fit):
        return found
    energies, nominal = runs_of(replay, robot), runs_of(replay, replay.robot)
    run = Run(after, energies, left_in_runs(replay, energies), allowed_in(replay, nominal))
    if nominal is None or energies is None or not run.whole:
        return found
    channels = [name for name in fit.channels if name in replay.channels]
    if not channels:
        return found
    every = range(len(replay.asked))
    errors = [[replay.errors(one, which) or {} for which in every] for one in (replay.robot, robot)]
    return _by_runs(replay, found, channels, errors)


def _by_runs(
    replay: Replay, found: Scored, channels: Sequence[str], errors: Sequence[Sequence[Mapping[str, Array]]]
) -> Scored:
    """The same of runs; `errors` in units of noise: before and after, of each recording and channel."""
    count = len(replay.asked)
    unseen = range(replay.fitted, count) if count > replay.fitted else range(count)
    parts = (range(replay.fitted), unseen)
    fits = {}
    for name in channels:
        sizes = replay.sizes(name)
        before, after = (
            Errors(*(_rms([sizes[k] * own[k][name] for k in part]) for part in parts)) for own in errors
        )
        all_of_it = [max(_rms([replay.asked[k].recording[name] for k in part]), 1e-300) for part in parts]
        fits[name] = ChannelFit(
            found.fit.channels[name].unit,
            before,
            after,
            _rms([np.array(sizes)[list(unseen)]]),
            *(
                Errors(rms.train_rms / all_of_it[0], rms.validation_rms / all_of_it[1])
                for rms in (before, after)
            ),
        )
    energy = [_rms([own[k][name] for k in unseen for name in replay.channels]) ** 2 for own in errors]
    excess = [max(e - 1.0, 0.0) for e in energy]
    improvement = 1.0 - float(np.sqrt(energy[1] / energy[0]))
    series = [s for s in found.series if s.channel not in channels]
    for k in range(count):
        for name in channels:
            own = [s for s in found.series if s.channel == name]
            if len(own) == count:  # of each recording one
                series.append(_ran(replay, k, own[k], *(part[k][name] for part in errors)))
    fit = Fit({**found.fit.channels, **fits}, improvement)
    return Scored(fit, 1.0 - excess[1] / max(excess[0], 1e-300), tuple(series), by_runs=True)


def _ran(replay: Replay, which: int, along: ChannelSeries, before: Array, after: Array) -> ChannelSeries:
    """A channel of one recording as both robots' runs give it."""
    recording, name = replay.asked[which].recording, along.channel
    time, size = recording.time, replay.sizes(name)[which]
    fitted = which < replay.fitted
    place = (along.position, along.velocity)
    position, velocity = (None if v is None else np.interp(time, along.time, v) for v in place)
    return replace(
        along,
        time=time,
        measured=recording[name],
        nominal=recording[name] - size * before,
        augmented=recording[name] - size * after,
        held_out=np.full(time.size, not fitted),
        noise_floor=size,
        position=position,
        velocity=velocity,
        counted=None,
    )


def _rms(parts: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) if parts else 0.0
