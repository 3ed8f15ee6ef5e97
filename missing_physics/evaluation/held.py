"""Torque commands that a sampled controller holds until its next sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from reference_model.control.laws import sample_time
from robot_model import Recording, Robot

__all__ = ["as_held"]

Array = NDArray[np.float64]


def as_held(torque: Array, time: Array, robot: Robot, recording: Recording, channel: str | None) -> Array:
    """Torque of an actuator at the time at which it took effect, shape (N,).

    A recorded value holds for the period of the controller, or until the next sample if that is sooner:
    on average it takes effect half of that time after it is recorded. Unchanged for a continuous controller
    and where the torque is not recorded or not known throughout.

    Args:
        torque: at `time`, shape (N,) [N m or N].
        time: uniform [s], shape (N,).
        robot: with its controller.
        recording: from which the torque comes.
        channel: in which it is recorded, if any.
    """
    period = sample_time(robot)
    if period <= 0.0 or channel is None or not np.isfinite(torque).all():
        return torque
    own = float(np.median(np.diff(recording.time[np.isfinite(recording[channel])])))
    spline = make_interp_spline(time, torque, k=3)
    return np.asarray(spline(np.maximum(time - 0.5 * min(period, own), time[0])))
