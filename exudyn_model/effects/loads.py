"""Other forces on a joint: harness springs, stops, and torques from outside."""

from __future__ import annotations

from dataclasses import dataclass
from math import tanh

from exudyn_model.effects.base import Instant, Momentary

__all__ = ["CableSpring", "EndStop", "ExternalTorque"]


@dataclass(frozen=True)
class CableSpring(Momentary):
    """T = T_0 - k q."""

    stiffness: float
    torque_at_zero: float = 0.0

    def force(self, now: Instant) -> float:
        return self.torque_at_zero - self.stiffness * now.position


@dataclass(frozen=True)
class EndStop(Momentary):
    """T = -s k max(s (q - q_s), 0), s = +1 for an upper and -1 for a lower stop."""

    stiffness: float
    position: float
    side: float = 1.0

    def force(self, now: Instant) -> float:
        return -self.side * self.stiffness * max(self.side * (now.position - self.position), 0.0)


@dataclass(frozen=True)
class ExternalTorque(Momentary):
    """T = T_0 (tanh((t - t_0)/e) - tanh((t - t_0 - d)/e)) / 2: for d seconds from t_0, edges of width e."""

    torque: float
    start: float
    duration: float
    edge: float = 0.01

    def force(self, now: Instant) -> float:
        begun = tanh((now.time - self.start) / self.edge)
        ended = tanh((now.time - self.start - self.duration) / self.edge)
        return self.torque * (begun - ended) / 2
