"""Signal path of a torque into the log: a delay or a low-pass, before noise and rounding.

A recording is sampled more slowly than a drive works, so torques are simulated on a finer grid: at a
kilohertz at least, and at every tick of a controller that holds its command. On it a held command is a
staircase and any other torque is linear between samples; both are delayed and filtered exactly.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, cont2discrete, lfilter, lfilter_zi

from missing_physics.challenge.cases.conditions import TorqueRecord
from robot_model import Recording, Robot

__all__ = ["RECORDED", "TorquePath", "logged"]

Array = NDArray[np.float64]

#: Quantity of the logged torque without noise in a recording without sensors.
RECORDED = "recorded_torque"
#: Minimum rate at which a torque is simulated [Hz].
FINEST = 1000.0
#: Tolerance for a tick on the grid, as a fraction of a step (rounding).
ON_GRID = 1e-6
#: Settling time of the noise in a low-pass: 15 time constants of the lowest corner frequency.
SETTLING = 16


@dataclass(frozen=True)
class TorquePath:
    """Signal path from the actuator torque to the log.

    Attributes:
        record: how the torque is recorded.
        hold: time for which the controller holds its command [s]; 0 if it does not.
        rate: sampling rate of the recording [Hz].
    """

    record: TorqueRecord
    hold: float
    rate: float

    @property
    def plain(self) -> bool:
        """Whether the torque is recorded without delay or filter."""
        return self.record.kind in ("command", "measured")

    @property
    def steps(self) -> int:
        """Steps of the finer grid per sample."""
        if self.plain:
            return 1
        ticks = max(1, round(1 / (self.rate * self.hold))) if self.hold else 1
        return ticks * math.ceil(FINEST / (self.rate * ticks) - ON_GRID)

    def finer(self, robot: Robot) -> Robot:
        """`robot` with its reference motion sampled on the finer grid."""
        assert robot.reference is not None
        rate = robot.reference.sample_rate * self.steps
        return robot.model_copy(
            update={"reference": robot.reference.model_copy(update={"sample_rate": rate})}
        )

    def logged(self, recording: Recording, joints: Iterable[str]) -> Recording:
        """Sample a recording on the finer grid at the log's rate, and add the logged torque of `joints`.

        The logged torque is added as `RECORDED`; the torque itself is kept.
        """
        kept = {name: values[:: self.steps] for name, values in recording.channels.items()}
        for joint in joints:
            kept[f"{joint}.{RECORDED}"] = self.passed(recording[f"{joint}.torque"])
        return Recording(recording.time[:: self.steps], kept, recording.source)

    def passed(self, torque: Array) -> Array:
        """Logged torque, without noise, of a torque on the finer grid."""
        fine, held = self.rate * self.steps, self.hold > 0
        if self.record.kind == "delayed":
            return self._delayed(torque, fine, staircase=held)[:: self.steps]
        if self.record.kind == "filtered":
            return self._filtered(torque, fine, staircase=held)[:: self.steps]
        return torque

    def passed_part(self, torque: Array) -> Array:
        """The same for a smooth part of a torque that is known only at the log's rate."""
        if self.record.kind == "delayed":
            return self._delayed(torque, self.rate, staircase=False)
        if self.record.kind == "filtered":
            return self._filtered(torque, self.rate, staircase=False)
        return torque

    def _delayed(self, torque: Array, rate: float, *, staircase: bool) -> Array:
        """Delayed torque; before the recording it is constant."""
        at = np.arange(len(torque)) - self.record.delay * rate
        if staircase:
            return np.asarray(torque[np.maximum(np.floor(at + ON_GRID).astype(int), 0)])
        return np.interp(at, np.arange(len(torque)), torque)

    def _filtered(self, values: Array, rate: float, *, staircase: bool) -> Array:
        """Low-pass filtered values, with a steady initial state."""
        b, a = self._filter(rate, staircase=staircase)
        return np.asarray(lfilter(b, a, values, zi=lfilter_zi(b, a) * values[0])[0])

    def _filter(self, rate: float, *, staircase: bool) -> tuple[Array, Array]:
        """The low-pass in discrete time, exact for a staircase or for values linear between samples."""
        continuous = butter(self.record.order, 2 * np.pi * self.record.corner, analog=True)
        b, a, _ = cont2discrete(continuous, 1 / rate, method="zoh" if staircase else "foh")
        return np.ravel(b), np.ravel(a)

    @property
    def noise_gain(self) -> float:
        """rms of the sensor's white noise of unit variance after the low-pass: sqrt(sum h^2)."""
        return 1.0 if self.record.kind != "filtered" else float(np.linalg.norm(self._response()))

    def _response(self) -> Array:
        """Impulse response to one sample of the sensor's noise."""
        impulse = np.zeros(self._settling)
        impulse[0] = 1.0
        return np.asarray(lfilter(*self._filter(self.rate, staircase=True), impulse))

    @property
    def _settling(self) -> int:
        return SETTLING * math.ceil(self.rate / (2 * np.pi * self.record.corner)) + SETTLING

    def noise(self, samples: int, chance: np.random.Generator) -> Array:
        """Noise of unit rms after the low-pass, as logged at constant torque."""
        response = self._response()
        white = chance.normal(size=samples + len(response))
        return np.asarray(lfilter(response, [1.0], white)[len(response) :]) / self.noise_gain


def logged(exact: Recording, joint: str) -> Array:
    """The logged torque of a joint without noise."""
    recorded = f"{joint}.{RECORDED}"
    return exact[recorded if recorded in exact else f"{joint}.torque"]
