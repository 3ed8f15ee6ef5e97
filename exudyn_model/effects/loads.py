"""Other forces on a joint: harness springs and torques from outside."""

from __future__ import annotations

from dataclasses import dataclass

from exudyn_model.effects.base import Instant, JointLaw

__all__ = ["CableSpring", "ExternalTorque"]


@dataclass(frozen=True)
class CableSpring(JointLaw):
    """T = -k (q - q_0)."""

    stiffness: float
    neutral_position: float = 0.0

    def force(self, now: Instant) -> float:
        return -self.stiffness * (now.position - self.neutral_position)


@dataclass(frozen=True)
class ExternalTorque(JointLaw):
    """T = T_0 from `start` to `stop`, else 0."""

    torque: float
    start: float
    stop: float

    def force(self, now: Instant) -> float:
        return self.torque if self.start <= now.time < self.stop else 0.0
