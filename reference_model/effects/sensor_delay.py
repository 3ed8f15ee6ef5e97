"""Sensor delay: a channel is recorded later than the others."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.effects.base import Parameter, SensorEffect, SensorSignals, Values
from reference_model.effects.resample import value_at

__all__ = ["SensorDelay"]


class SensorDelay(SensorEffect):
    """measured(t) = true(t - delay); the error is -delay d(true)/dt to first order."""

    id = "sensor_delay"
    title = "Sensor delay"
    searched_in = frozenset({"position", "angular_velocity"})
    parameters = (
        # Negative: the other channels of the recording are late.
        Parameter(
            "delay",
            "s",
            "delay of the channel relative to the others",
            -0.1,
            0.5,
            2e-3,
            absent=0.0,
            linear=True,
        ),
    )
    is_beyond_standard = False  # which estimates the delays of torques
    equation = "measured(t) = true(t - delay)"
    source = (
        "Franklin, Powell and Emami-Naeini, Feedback Control of Dynamic Systems (2010), ch. 6 "
        "(time delay in the frequency response)"
    )
    signature = (
        "an error in proportion to the channel's rate; its phase falls in a straight line with frequency"
    )
    confused_with = ("viscous_friction", "actuator_lag", "modal_damping", "clock_drift")
    experiment = "one event that all sensors see; or a sweep, and the slope of phase against frequency"

    def error(self, s: SensorSignals, p: Values) -> ca.SX:
        return -p["delay"] * s.rate

    def apply(
        self, time: NDArray[np.float64], values: NDArray[np.float64], p: Mapping[str, float]
    ) -> NDArray[np.float64]:
        return value_at(time, values, time - p["delay"])
