"""Whether a robot file has the errors stated by its diagnosis."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation import evaluate
from missing_physics.results.result import Result
from robot_model import Recording, robot_from_toml

__all__ = ["DIFFERENT", "held_out_errors", "require_stated_errors"]

Array = NDArray[np.float64]

#: Errors differ by more than this part of themselves.
DIFFERENT = 0.01


def held_out_errors(result: Result, recordings: Sequence[Recording]) -> Iterator[tuple[str, float, float]]:
    """Channel, the error that is stated for held-out data, and that of the robot file as it is written.

    Args:
        result: a finished diagnosis.
        recordings: all of them, those that were fitted first.
    """
    fit, robot = result.diagnosis.fit, robot_from_toml(result.augmented_robot_toml)
    made = [evaluate(robot, recording, band) for recording, band in zip(recordings, fit.bands)]
    left: dict[str, list[Array]] = {}
    seen: Counter[str] = Counter()
    for series in result.series:
        number = seen[series.channel]
        seen[series.channel] += 1
        if series.counted is None or number >= len(made):
            continue
        instants = series.time[series.held_out & series.counted]
        left.setdefault(series.channel, []).append(made[number].at(instants, series.channel))
    for channel, parts in left.items():
        every = np.concatenate(parts)
        if every.size:
            stated = fit.channels[channel].after.validation_rms
            yield channel, stated, float(np.sqrt(np.mean(every**2)))


def require_stated_errors(result: Result, recordings: Sequence[Recording]) -> None:
    """Fails where the file of a finished diagnosis does not have the held-out errors that are stated."""
    for channel, stated, found in held_out_errors(result, recordings):
        assert abs(found - stated) <= DIFFERENT * stated, f"{channel}: {stated} stated, {found} by the file"
