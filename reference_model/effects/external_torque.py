"""External torque: a temporary push on the joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import Extent, JointEffect, JointSignals, Parameter, Values

__all__ = ["ExternalTorque"]

#: At most this many windows are tried.
MOST_WINDOWS = 8
#: Fractions of the recording that are tried when no window stands out: start and length.
BLIND_WINDOWS = ((0.1, 0.2), (0.4, 0.2), (0.7, 0.2))


class ExternalTorque(JointEffect):
    """T = torque while start < t < start + duration, with edges smoothed by tanh over `edge`."""

    id = "external_torque"
    title = "Temporary external torque"
    place = "joint"
    is_event = True
    essential = ("start",)
    parameters = (
        Parameter("torque", "N m", "generalised force on the joint", -1e5, 1e5, 5.0, absent=0.0, linear=True),
        Parameter("start", "s", "when it begins", 0.0, 1e6, 1.0),
        Parameter("duration", "s", "how long it lasts", 1e-4, 1e6, 0.5),
        Parameter("edge", "s", "rise and fall time", 1e-4, 10.0, 0.01, estimated=False, default=0.01),
    )
    equation = "T = torque * (tanh((t - start)/edge) - tanh((t - start - duration)/edge)) / 2"
    source = "De Luca and Mattone, ICRA 2005 (external torques from the generalised momentum)"
    signature = "a residual in a window of time that does not recur when the motion is repeated"
    confused_with = ("contact", "end_stop", "torque_saturation", "torque_offset")
    experiment = "repeat the motion: an external torque does not come back at the same place"

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        begun = ca.tanh((s.time - p["start"]) / p["edge"])
        ended = ca.tanh((s.time - p["start"] - p["duration"]) / p["edge"])
        return p["torque"] * (begun - ended) / 2

    def bounds(self, extent: Extent) -> Mapping[str, tuple[float, float]]:
        shortest = self.parameter("duration").lower
        longest = max(extent.duration, 2.0 * shortest)
        first = max(extent.begin, self.parameter("start").lower)
        last = max(extent.begin + longest, first + shortest)
        return {"start": (first, last), "duration": (shortest, longest)}

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        blind = [
            (extent.begin + a * extent.duration, extent.begin + (a + b) * extent.duration)
            for a, b in BLIND_WINDOWS
        ]
        windows = extent.windows[:MOST_WINDOWS] or blind
        shortest = max(2 * extent.sample_time, self.parameter("duration").lower)
        return tuple({"start": max(a, 0.0), "duration": max(b - a, shortest)} for a, b in windows)
