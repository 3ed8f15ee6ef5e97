"""Recordings corrected for the sensor errors that the robot file lists."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.sensors import without_error
from reference_model.effects.base import SensorEffect
from reference_model.effects.catalogue import used_effects
from robot_model import Recording, Robot

__all__ = ["without_sensor_errors"]

Array = NDArray[np.float64]


def without_sensor_errors(robot: Robot, recording: Recording) -> Recording:
    """The recording without the sensor errors of the robot file.

    Channels that the recording lacks are skipped.
    """
    found: dict[str, Array] = {}
    for used in reversed(used_effects(robot)):
        channel = used.at
        if not isinstance(used.effect, SensorEffect) or channel not in recording:
            continue
        values = found.get(channel, recording[channel]).copy()
        good = np.isfinite(values)
        if np.count_nonzero(good) > 1:
            values[good] = without_error(recording.time[good], values[good], used)
        found[channel] = values
    return recording.with_channels(found) if found else recording
