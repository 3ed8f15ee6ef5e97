"""Sensor faults: wrong values of a channel, without change of motion."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

__all__ = ["ClockDrift", "EncoderEccentricity", "SensorDelay", "SensorFault", "SensorGain", "SensorOffset"]

Array = NDArray[np.float64]


class SensorFault(ABC):
    """Base of the faults; parameters are the fields of the concrete class, in SI units."""

    @abstractmethod
    def applied(self, time: Array, values: Array) -> Array:
        """The sensor's reading of true `values` at `time` [s], shape (N,)."""


@dataclass(frozen=True)
class SensorOffset(SensorFault):
    """y = x + b."""

    offset: float

    def applied(self, time: Array, values: Array) -> Array:
        return values + self.offset


@dataclass(frozen=True)
class SensorGain(SensorFault):
    """y = (1 + e) x."""

    gain_error: float

    def applied(self, time: Array, values: Array) -> Array:
        return (1 + self.gain_error) * values


@dataclass(frozen=True)
class SensorDelay(SensorFault):
    """y(t) = x(t - d); before the recording began, its first value."""

    delay: float

    def applied(self, time: Array, values: Array) -> Array:
        return _at(time, values, time - self.delay)


@dataclass(frozen=True)
class EncoderEccentricity(SensorFault):
    """y = x + a cos(k x) + b sin(k x)."""

    cosine: float
    sine: float
    order: float = 1.0

    def applied(self, time: Array, values: Array) -> Array:
        return values + self.cosine * np.cos(self.order * values) + self.sine * np.sin(self.order * values)


@dataclass(frozen=True)
class ClockDrift(SensorFault):
    """y(t) = x((1 + e) t): the channel runs ahead at the relative rate e."""

    rate: float

    def applied(self, time: Array, values: Array) -> Array:
        return _at(time, values, time * (1 + self.rate))


def _at(time: Array, values: Array, instants: Array) -> Array:
    """Values between the samples; a monotone cubic does not overshoot where friction jumps. Held outside."""
    if len(time) < 2:
        return values
    return np.asarray(PchipInterpolator(time, values)(np.clip(instants, time[0], time[-1])))
