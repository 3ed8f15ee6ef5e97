"""User-defined forces on the joints, outside the robot's description."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from exudyn_model.effects.base import Memory

__all__ = ["ArmInstant", "ExtraForce"]


@dataclass(slots=True)
class ArmInstant:
    """The state of all moving joints now, and at the last accepted instant `step` earlier.

    Attributes:
        time: [s].
        step: since the last accepted instant [s]; 0 at the start.
        position, velocity: in the order of the file [rad or m, per s].
        command: commanded actuator torques [N m or N].
        last_velocity, last_command: at the last accepted instant.
    """

    time: float
    step: float
    position: Sequence[float]
    velocity: Sequence[float]
    command: Sequence[float]
    last_velocity: Sequence[float]
    last_command: Sequence[float]


class ExtraForce(ABC):
    """Generalised forces on all joints, added to those of the robot's effects.

    As with the laws of effects, forces at a trial state are a pure function of that state and of the memory
    at the last accepted instant.
    """

    def initial(self, now: ArmInstant) -> Memory:
        """Initial memory."""
        return ()

    @abstractmethod
    def advance(self, now: ArmInstant, memory: Memory) -> tuple[Sequence[float], Memory]:
        """Force on each joint [N m or N], and the memory if this instant is accepted."""
