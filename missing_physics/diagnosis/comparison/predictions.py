"""Prediction errors of a robot file on fitted and on held-out samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation import Evaluation, evaluate
from missing_physics.results.comparison import Errors
from missing_physics.results.samples import Rows
from robot_model import InputError, Recording, Robot

__all__ = ["Predictions", "predictions"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Predictions:
    """Predictions of one robot file and their errors.

    Attributes:
        robot: the file.
        made: its evaluation along each recording.
        errors: rms by channel over the compared samples.
        samples: independent held-out samples by channel: two per period of the band's end.
    """

    robot: Robot
    made: tuple[Evaluation, ...]
    errors: dict[str, Errors]
    samples: dict[str, float]

    def log_score(self) -> float:
        """Log density of the held-out samples [nats].

        Gaussian, with the variance of the residual in the fitted samples of each channel.
        """
        total = 0.0
        for channel, errors in self.errors.items():
            variance = max(errors.train_rms**2, np.finfo(float).tiny)
            each = np.log(2.0 * np.pi * variance) + errors.validation_rms**2 / variance
            total -= 0.5 * self.samples[channel] * float(each)
        return total


def predictions(robot: Robot, recordings: Sequence[Recording], rows: Sequence[Rows]) -> Predictions | None:
    """Predictions of `robot`; None if it cannot be evaluated along these recordings.

    Args:
        robot: any robot file.
        recordings: as many as `rows`.
        rows: compared samples; channels without held-out samples are skipped.
    """
    try:
        made = tuple(evaluate(robot, recording, own.band) for recording, own in zip(recordings, rows))
    except InputError:
        return None
    errors, samples, step = {}, {}, float(rows[0].time[1] - rows[0].time[0])
    for k, channel in enumerate(rows[0].channels):
        if any(channel not in one.channels for one in made):
            continue
        parts = [_residual(one, own, channel, k) for one, own in zip(made, rows)]
        fitted, held_out = (np.concatenate([part[which] for part in parts]) for which in (0, 1))
        if fitted.size and held_out.size and np.isfinite(held_out).all():
            errors[channel] = Errors(_rms(fitted), _rms(held_out))
            samples[channel] = held_out.size * min(1.0, 2.0 * rows[0].band.torque * step)
    return Predictions(robot, made, errors, samples)


def _residual(made: Evaluation, rows: Rows, channel: str, k: int) -> tuple[Array, Array]:
    """Residual of one channel in fitted and in held-out samples."""
    residual, counted = made.at(rows.time, channel), rows.counted[:, k]
    return residual[counted & ~rows.held_out], residual[counted & rows.held_out]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
