"""Actuator effects: delivered minus commanded torque."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, log1p, sin

from exudyn_model.effects.base import Instant, JointLaw, Memory, Momentary

__all__ = ["ActuatorLag", "TorqueGain", "TorqueOffset", "TorqueRipple", "TorqueSaturation"]

#: Width of the corner of a saturation, relative to its limit.
ROUNDING = 0.005
#: Keeps a lag of zero from dividing by it [s].
SMALLEST_LAG = 1e-6


@dataclass(frozen=True)
class TorqueGain(Momentary):
    """T = e u."""

    role = "drive"
    gain_error: float

    def force(self, now: Instant) -> float:
        return self.gain_error * now.command


@dataclass(frozen=True)
class TorqueOffset(Momentary):
    """T = T_0."""

    role = "drive"
    torque: float

    def force(self, now: Instant) -> float:
        return self.torque


@dataclass(frozen=True)
class TorqueRipple(Momentary):
    """T = (a + a_r u) cos(k q) + (b + b_r u) sin(k q): cogging, and ripple in proportion to the command."""

    role = "drive"
    cosine: float
    sine: float
    order: float
    cosine_per_torque: float = 0.0
    sine_per_torque: float = 0.0

    def force(self, now: Instant) -> float:
        phase = self.order * now.position
        cosine = self.cosine + self.cosine_per_torque * now.command
        sine = self.sine + self.sine_per_torque * now.command
        return cosine * cos(phase) + sine * sin(phase)


@dataclass(frozen=True)
class TorqueSaturation(Momentary):
    """T = clip(u, -limit, limit) - u, the corner rounded over a small fraction of the limit."""

    role = "drive"
    limit: float

    def force(self, now: Instant) -> float:
        return self._excess(-now.command) - self._excess(now.command)

    def _excess(self, torque: float) -> float:
        """max(torque - limit, 0), rounded: width log(1 + exp((torque - limit) / width))."""
        width = ROUNDING * self.limit
        scaled = (torque - self.limit) / width
        return width * (max(scaled, 0.0) + log1p(exp(-abs(scaled))))


@dataclass(frozen=True)
class ActuatorLag(JointLaw):
    """T = y - u with T_l yd = u - y, from y = u at the start; T_l is never less than `SMALLEST_LAG`.

    Over a step the lag is advanced in closed form for a command that is linear in time.
    """

    role = "drive"
    time_constant: float

    def initial(self, now: Instant) -> Memory:
        return (now.command,)

    def advance(self, now: Instant, memory: Memory) -> tuple[float, Memory]:
        y = self._delivered(now, memory[0])
        return y - now.command, (y,)

    def _delivered(self, now: Instant, y: float) -> float:
        if now.step == 0.0:
            return y
        lag, slope = self.time_constant + SMALLEST_LAG, (now.command - now.last_command) / now.step
        trailing = now.command - slope * lag  # where a ramp would have settled
        return trailing + (y - (now.last_command - slope * lag)) * exp(-now.step / lag)
