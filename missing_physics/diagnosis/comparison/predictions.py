"""What a robot file leaves of the recordings, on samples that were fitted and on those that were not."""

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
    """Of one robot file.

    Attributes:
        robot: the file.
        made: what it predicts of each recording.
        errors: rms by channel, of the samples that count.
        samples: independent samples that were not fitted, by channel: two in a period of the band's end.
    """

    robot: Robot
    made: tuple[Evaluation, ...]
    errors: dict[str, Errors]
    samples: dict[str, float]

    def log_score(self) -> float:
        """Logarithm of the density that the file gave to what was not fitted [nats].

        Gaussian, in every channel with the variance that the file left in the fitted samples.
        """
        total = 0.0
        for channel, errors in self.errors.items():
            variance = max(errors.train_rms**2, np.finfo(float).tiny)
            each = np.log(2.0 * np.pi * variance) + errors.validation_rms**2 / variance
            total -= 0.5 * self.samples[channel] * float(each)
        return total


def predictions(robot: Robot, recordings: Sequence[Recording], rows: Sequence[Rows]) -> Predictions | None:
    """Errors of `robot`; None where it cannot be evaluated along these recordings.

    Args:
        robot: any robot file.
        recordings: as many as `rows`.
        rows: samples that count; channels without any in which they were held out are left out.
    """
    try:
        made = tuple(evaluate(robot, recording, own.band) for recording, own in zip(recordings, rows))
    except InputError:
        return None
    errors, samples, step = {}, {}, float(rows[0].time[1] - rows[0].time[0])
    for k, channel in enumerate(rows[0].channels):
        if any(channel not in one.channels for one in made):
            continue
        parts = [_left(one, own, channel, k) for one, own in zip(made, rows)]
        fitted, unseen = (np.concatenate([part[which] for part in parts]) for which in (0, 1))
        if fitted.size and unseen.size and np.isfinite(unseen).all():
            errors[channel] = Errors(_rms(fitted), _rms(unseen))
            samples[channel] = unseen.size * min(1.0, 2.0 * rows[0].band.torque * step)
    return Predictions(robot, made, errors, samples)


def _left(made: Evaluation, rows: Rows, channel: str, k: int) -> tuple[Array, Array]:
    """Residual of one channel in samples that were fitted, and in those that were not."""
    left, counted = made.at(rows.time, channel), rows.counted[:, k]
    return left[counted & ~rows.held_out], left[counted & rows.held_out]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
