"""Sensor gain: a channel is scaled by a constant factor."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.effects.base import Parameter, SensorEffect, SensorSignals, Values

__all__ = ["SensorGain"]


class SensorGain(SensorEffect):
    """measured = (1 + e) true."""

    id = "sensor_gain"
    title = "Sensor gain error"
    searched_in = frozenset({"position", "torque", "angular_velocity"})
    parameters = (
        Parameter(
            "gain_error", "-", "measured over true, minus one", -0.9, 2.0, 0.02, absent=0.0, linear=True
        ),
    )
    equation = "measured = (1 + gain_error) * true"
    source = "Doebelin, Measurement Systems: Application and Design (1990), ch. 3 (static sensitivity)"
    signature = "an error proportional to the channel in every regime"
    confused_with = ("torque_gain", "inertia", "payload", "joint_elasticity")
    experiment = "a known value to compare with: a weight on a lever, a mechanical stop, a second encoder"

    def error(self, s: SensorSignals, p: Values) -> ca.SX:
        return p["gain_error"] * s.value

    def apply(
        self, time: NDArray[np.float64], values: NDArray[np.float64], p: Mapping[str, float]
    ) -> NDArray[np.float64]:
        return (1 + p["gain_error"]) * values
