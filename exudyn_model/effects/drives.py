"""What happens to the commanded torque on its way to the joint: delivered minus commanded."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, sin

from exudyn_model.effects.base import Instant, JointLaw, Memory

__all__ = ["ActuatorLag", "TorqueGain", "TorqueOffset", "TorqueRipple", "TorqueSaturation"]


@dataclass(frozen=True)
class TorqueGain(JointLaw):
    """T = e u."""

    role = "drive"
    error: float

    def force(self, now: Instant) -> float:
        return self.error * now.command


@dataclass(frozen=True)
class TorqueOffset(JointLaw):
    """T = T_0."""

    role = "drive"
    torque: float

    def force(self, now: Instant) -> float:
        return self.torque


@dataclass(frozen=True)
class TorqueRipple(JointLaw):
    """T = a cos(k q) + b sin(k q)."""

    role = "drive"
    cosine: float
    sine: float
    order: float

    def force(self, now: Instant) -> float:
        phase = self.order * now.position
        return self.cosine * cos(phase) + self.sine * sin(phase)


@dataclass(frozen=True)
class TorqueSaturation(JointLaw):
    """T = clip(u, -limit, limit) - u."""

    role = "drive"
    limit: float

    def force(self, now: Instant) -> float:
        return max(-self.limit, min(self.limit, now.command)) - now.command


@dataclass(frozen=True)
class ActuatorLag(JointLaw):
    """T = y - u with T_l yd = u - y, from y = u at the start.

    Over a step the lag is advanced in closed form for a command that is linear in time.
    """

    role = "drive"
    remembers = True
    time_constant: float

    def initial(self, now: Instant) -> Memory:
        return (now.command,)

    def advance(self, now: Instant, memory: Memory) -> tuple[float, Memory]:
        y = self._delivered(now, memory[0])
        return y - now.command, (y,)

    def _delivered(self, now: Instant, y: float) -> float:
        if now.step == 0.0:
            return y
        lag, slope = self.time_constant, (now.command - now.last_command) / now.step
        trailing = now.command - slope * lag  # where a ramp would have settled
        return trailing + (y - (now.last_command - slope * lag)) * exp(-now.step / lag)
