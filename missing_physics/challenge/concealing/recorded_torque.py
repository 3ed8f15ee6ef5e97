"""What becomes of a torque on its way into the log: a delay or a low-pass, before noise and rounding.

A recording is sampled more slowly than a drive works, so torques are followed on a finer grid: at a
kilohertz at least, and at every tick of a controller that holds its command. There a held command is a
staircase and any other torque linear between samples, and both are delayed and filtered exactly.
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

#: Quantity under which a recording without sensors keeps the torque as it is logged, noise left out.
RECORDED = "recorded_torque"
#: Slowest sampling at which a torque is followed [Hz].
FINEST = 1000.0
#: A tick counts as on the grid within this share of a step (rounding).
ON_GRID = 1e-6
#: Samples after which the noise in a low-pass forgets where it began: 15 time constants of the lowest corner.
SETTLING = 16


@dataclass(frozen=True)
class TorquePath:
    """The way from the actuator's torque to the log.

    Attributes:
        record: how the torque is recorded.
        hold: time for which the controller holds its command [s]; 0 where it does not.
        rate: sampling rate of the recording [Hz].
    """

    record: TorqueRecord
    hold: float
    rate: float

    @property
    def plain(self) -> bool:
        """The torque is recorded as it is at each instant."""
        return self.record.kind in ("command", "measured")

    @property
    def steps(self) -> int:
        """Steps of the finer grid per sample."""
        if self.plain:
            return 1
        ticks = max(1, round(1 / (self.rate * self.hold))) if self.hold else 1
        return ticks * math.ceil(FINEST / (self.rate * ticks) - ON_GRID)

    def finer(self, robot: Robot) -> Robot:
        """`robot`, its reference motion sampled on the finer grid."""
        assert robot.reference is not None
        rate = robot.reference.sample_rate * self.steps
        return robot.model_copy(
            update={"reference": robot.reference.model_copy(update={"sample_rate": rate})}
        )

    def logged(self, recording: Recording, joints: Iterable[str]) -> Recording:
        """A recording on the finer grid at the log's instants, with the torque of `joints` as logged.

        That is kept as `RECORDED`, apart from the torque itself.
        """
        kept = {name: values[:: self.steps] for name, values in recording.channels.items()}
        for joint in joints:
            kept[f"{joint}.{RECORDED}"] = self.passed(recording[f"{joint}.torque"])
        return Recording(recording.time[:: self.steps], kept, recording.source)

    def passed(self, torque: Array) -> Array:
        """What the log holds at its instants of a torque on the finer grid, noise left out."""
        fine, held = self.rate * self.steps, self.hold > 0
        if self.record.kind == "delayed":
            return self._late(torque, fine, staircase=held)[:: self.steps]
        if self.record.kind == "filtered":
            return self._filtered(torque, fine, staircase=held)[:: self.steps]
        return torque

    def passed_part(self, torque: Array) -> Array:
        """The same of a smooth part of a torque that is known at the log's instants only."""
        if self.record.kind == "delayed":
            return self._late(torque, self.rate, staircase=False)
        if self.record.kind == "filtered":
            return self._filtered(torque, self.rate, staircase=False)
        return torque

    def _late(self, torque: Array, rate: float, *, staircase: bool) -> Array:
        """Of the torque at time - delay; before the recording it is what it is at the beginning."""
        at = np.arange(len(torque)) - self.record.delay * rate
        if staircase:
            return np.asarray(torque[np.maximum(np.floor(at + ON_GRID).astype(int), 0)])
        return np.interp(at, np.arange(len(torque)), torque)

    def _filtered(self, values: Array, rate: float, *, staircase: bool) -> Array:
        """Through the low-pass, at rest in the beginning."""
        b, a = self._filter(rate, staircase=staircase)
        return np.asarray(lfilter(b, a, values, zi=lfilter_zi(b, a) * values[0])[0])

    def _filter(self, rate: float, *, staircase: bool) -> tuple[Array, Array]:
        """The low-pass in discrete time, exact for a staircase or for what is linear between samples."""
        continuous = butter(self.record.order, 2 * np.pi * self.record.corner, analog=True)
        b, a, _ = cont2discrete(continuous, 1 / rate, method="zoh" if staircase else "foh")
        return np.ravel(b), np.ravel(a)

    @property
    def noise_gain(self) -> float:
        """rms of white noise of the sensor, one value per sample, behind the low-pass: sqrt(sum h^2)."""
        return 1.0 if self.record.kind != "filtered" else float(np.linalg.norm(self._response()))

    def _response(self) -> Array:
        """Response to one sample of the sensor's noise."""
        impulse = np.zeros(self._settling)
        impulse[0] = 1.0
        return np.asarray(lfilter(*self._filter(self.rate, staircase=True), impulse))

    @property
    def _settling(self) -> int:
        return SETTLING * math.ceil(self.rate / (2 * np.pi * self.record.corner)) + SETTLING

    def noise(self, samples: int, chance: np.random.Generator) -> Array:
        """Noise of unit rms behind the low-pass, as the log shows it at a torque that is constant."""
        response = self._response()
        white = chance.normal(size=samples + len(response))
        return np.asarray(lfilter(response, [1.0], white)[len(response) :]) / self.noise_gain


def logged(exact: Recording, joint: str) -> Array:
    """The torque of a joint as it is logged, noise left out."""
    recorded = f"{joint}.{RECORDED}"
    return exact[recorded if recorded in exact else f"{joint}.torque"]
