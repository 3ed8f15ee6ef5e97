"""Decimation of recordings with more samples than a diagnosis accepts."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from missing_physics.diagnosis import most_samples
from missing_physics.recordings import PASSES, decimated, decimation_of, with_sensors
from robot_model import InputError, Recording, Robot

__all__ = ["thinned"]


def thinned(
    robot: Robot,
    recordings: Sequence[Recording],
    *,
    rate: float | None = None,
    tell: Callable[[str], object] = print,
) -> list[Recording]:
    """The recordings, decimated to as many samples as a diagnosis of the robot accepts.

    Args:
        robot: its number of joints sets the limit; the noise of its sensors is reduced by the filter.
        recordings: of any length.
        rate: wanted sampling rate [Hz]; the highest possible one when None.
        tell: called with a sentence for each decimated recording.

    Raises:
        InputError: a rate that is not positive, or that leaves too many samples.
    """
    if rate is not None and not rate > 0.0:
        raise InputError(f"the rate is {rate:g} Hz; it must be positive.")
    most, found = most_samples(robot), []
    for recording in recordings:
        factor = decimation_of(recording, most, rate=rate)
        if factor > 1:
            count, own = len(recording), recording.sample_rate
            new = own / factor
            why = "" if count <= most else f", since a diagnosis of this robot takes at most {most}"
            tell(
                f"{recording.source or 'the recording'}: {count} samples at {own:.4g} Hz become "
                f"{-(-count // factor)} at {new:.4g} Hz{why}; a filter takes out what is above "
                f"{PASSES * new / 2:.3g} Hz, and a shorter part keeps more."
            )
            recording = decimated(with_sensors(robot, recording), factor)
        found.append(recording)
    return found
