"""Sensor offset: a constant is added to a channel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.effects.base import Parameter, SensorEffect, SensorSignals, Values

__all__ = ["SensorOffset"]


class SensorOffset(SensorEffect):
    """measured = true + offset."""

    id = "sensor_offset"
    title = "Sensor offset"
    same_as: ClassVar[Mapping[str, str]] = {"torque": "torque_offset"}
    parameters = (
        Parameter("offset", "channel", "measured minus true", -1e6, 1e6, 0.01, absent=0.0, linear=True),
    )
    equation = "measured = true + offset"
    source = "Doebelin, Measurement Systems: Application and Design (1990), ch. 3 (zero drift)"
    signature = "a constant error, present at rest; in a position under gravity it shows as a wrong pose"
    confused_with = ("torque_offset", "gravity", "cable_spring", "asymmetric_friction")
    experiment = "standstill, unloaded and with the brake on; or turn the sensor's axis over"

    def error(self, s: SensorSignals, p: Values) -> ca.SX:
        return ca.SX(p["offset"])

    def apply(
        self, time: NDArray[np.float64], values: NDArray[np.float64], p: Mapping[str, float]
    ) -> NDArray[np.float64]:
        return values + p["offset"]
