"""How far free runs are from the recorded positions, before and after a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.free_run.problem import Trial
from missing_physics.diagnosis.free_run.recordings import Parts
from missing_physics.diagnosis.free_run.run import simulate_recording
from missing_physics.results.result import ChannelFit, ChannelSeries, Errors
from robot_model import Recording, Robot, unit_of

__all__ = ["position_fits", "position_series", "rms_positions"]

Array = NDArray[np.float64]


def position_fits(
    nominal: Robot, robot: Robot, parts: Parts, noise: Array, crossed: Array | None
) -> dict[str, ChannelFit]:
    """Errors of free runs of both robots, on the fitted part and on the part that decided nothing.

    Args:
        crossed: without such a part, the rms error of each joint in the deciding runs; those of the robot as
            it is when None.

    Raises:
        InputError: a run does not converge.
    """
    scored = parts.score or parts.fit
    gaps = {
        (number, role): _gaps(which, trials)
        for number, which in enumerate((nominal, robot))
        for role, trials in (("fit", parts.fit), ("score", scored))
    }
    found = {}
    for k, joint in enumerate(nominal.moving_joints):
        channel = f"{joint.name}.position"
        before, after = (Errors(_rms(gaps[n, "fit"][k]), _rms(gaps[n, "score"][k])) for n in (0, 1))
        if crossed is not None and not parts.score:
            after = Errors(after.train_rms, float(crossed[k]))
        levels = [_rms(np.concatenate([t.recording[channel] for t in ts])) for ts in (parts.fit, scored)]
        found[channel] = ChannelFit(
            unit=unit_of(channel, prismatic=joint.kind == "prismatic"),
            before=before,
            after=after,
            noise_floor=float(noise[k]),
            relative_error_before=_relative(before, levels),
            relative_error_after=_relative(after, levels),
        )
    return found


def rms_positions(robot: Robot, parts: Parts) -> list[list[float]]:
    """rms of every joint's recorded position, of the fitted and the deciding part, shape (2, n)."""
    levels = []
    for trials in (parts.fit, [trial for _, decide in parts.folds for trial in decide]):
        names = [f"{joint.name}.position" for joint in robot.moving_joints]
        levels.append([_rms(np.concatenate([t.recording[name] for t in trials])) for name in names])
    return levels


def position_series(
    nominal: Robot, robot: Robot, trials: Sequence[Trial], fitted: int, noise: Array
) -> tuple[ChannelSeries, ...]:
    """Free runs along whole recordings, the first `fitted` of which are the user's training recordings."""
    series = []
    for number, trial in enumerate(trials):
        recording = trial.recording
        validation = number >= fitted
        before, after = (_run(which, trial) for which in (nominal, robot))
        held = np.full(len(recording), validation)
        for k, joint in enumerate(nominal.moving_joints):
            channel = f"{joint.name}.position"
            series.append(
                ChannelSeries(
                    recording=recording.source,
                    role="validation" if validation else "train",
                    channel=channel,
                    unit=unit_of(channel, prismatic=joint.kind == "prismatic"),
                    location=joint.name,
                    time=recording.time,
                    measured=recording[channel],
                    nominal=before[channel],
                    augmented=after[channel],
                    held_out=held,
                    noise_floor=float(noise[k]),
                )
            )
    return tuple(series)


def _gaps(robot: Robot, trials: Sequence[Trial]) -> list[Array]:
    """Simulated minus recorded position of each joint, all recordings in a row."""
    columns: list[list[Array]] = [[] for _ in robot.moving_joints]
    for trial in trials:
        run = _run(robot, trial)
        for k, joint in enumerate(robot.moving_joints):
            channel = f"{joint.name}.position"
            columns[k].append(run[channel] - trial.recording[channel])
    return [np.concatenate(column) for column in columns]


def _run(robot: Robot, trial: Trial) -> Recording:
    return simulate_recording(robot, trial.recording, controller=trial.controller).recording


def _relative(errors: Errors, levels: Sequence[float]) -> Errors:
    pairs = zip((errors.train_rms, errors.validation_rms), levels)
    return Errors(*(error / max(level, 1e-300) for error, level in pairs))


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0
