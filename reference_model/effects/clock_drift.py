"""Clock drift: a channel's clock runs faster or slower than the recording's."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.effects.base import Parameter, SensorEffect, SensorSignals, Values
from reference_model.effects.resample import value_at

__all__ = ["ClockDrift"]


class ClockDrift(SensorEffect):
    """measured(t) = true(t (1 + rate)); the error is rate t d(true)/dt to first order."""

    id = "clock_drift"
    title = "Clock drift"
    searched_in = frozenset({"position", "torque", "angular_velocity"})
    parameters = (
        Parameter(
            "rate",
            "s/s",
            "relative rate by which the channel's clock runs ahead",
            -0.02,
            0.02,
            1e-4,
            absent=0.0,
            linear=True,
        ),
    )
    equation = "measured(t) = true(t * (1 + rate))"
    source = (
        "Moon, Skelly and Towsley, Estimation and Removal of Clock Skew from Network Delay Measurements, "
        "IEEE INFOCOM 1999, 227-234"
    )
    signature = "a delay against the other channels that grows over the recording"
    confused_with = ("sensor_delay", "temperature_dependent_friction")
    experiment = "cross-correlate two channels window by window: the lag grows in a straight line"

    def error(self, s: SensorSignals, p: Values) -> ca.SX:
        return p["rate"] * s.time * s.rate

    def apply(
        self, time: NDArray[np.float64], values: NDArray[np.float64], p: Mapping[str, float]
    ) -> NDArray[np.float64]:
        return value_at(time, values, time * (1 + p["rate"]))
