"""Recordings corrected for the sensor errors that the robot file lists."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.sensors import without_error
from reference_model.effects.base import GearEffect, SensorEffect
from reference_model.effects.catalogue import get_effect, used_effects
from robot_model import EffectUse, Recording, Robot

__all__ = ["restored", "stripped", "without_sensor_errors"]

Array = NDArray[np.float64]


def stripped(robot: Robot) -> Robot:
    """The robot without the effects of sensors and gears, for which recordings are corrected."""
    return robot.model_copy(update={"effects": tuple(use for use in robot.effects if not _is_known(use))})


def restored(file: Robot, robot: Robot) -> Robot:
    """A robot file with the effects that `stripped` left out of `robot`.

    Where a sensor errs otherwise than `robot` says, the parameters are added: errors are small, so that one
    after the other is their sum to first order.
    """
    known, more = [use for use in robot.effects if _is_known(use)], list(file.effects)
    for use in known:
        same = next((k for k, o in enumerate(more) if (o.effect, o.at) == (use.effect, use.at)), None)
        if same is None:
            more.append(use)
            continue
        other = more[same]
        linear = {p.name for p in get_effect(use.effect).parameters if p.absent == 0.0}
        sums = {n: v + use.parameters[n] * (n in linear) for n, v in other.parameters.items()}
        more[same] = EffectUse(effect=use.effect, at=use.at, **sums)
    return file.model_copy(update={"effects": tuple(more)})


def without_sensor_errors(robot: Robot, recording: Recording) -> Recording:
    """The recording as it were if the sensors did not err as the robot file says.

    Channels that the recording lacks are left alone.
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


def _is_known(use: EffectUse) -> bool:
    return isinstance(get_effect(use.effect), SensorEffect | GearEffect)
