"""Inputs and outputs of an effect at a joint, in plain numbers.

A law returns a generalised force on its joint coordinate [N m or N]: friction is negative at positive
speed, and the equation of motion is ``inverse dynamics = commanded torque + sum of laws``. Some laws have a
memory (a bristle, a lag). They receive the memory of the last accepted instant and return the present one, so
that a rejected iteration leaves no trace.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import tanh
from typing import ClassVar, Literal

__all__ = ["TRANSITION", "Instant", "JointLaw", "Memory", "Momentary", "Role", "smooth_sign"]

#: Speed over which a discontinuous law passes through zero, tanh(v / TRANSITION) [rad/s or m/s].
TRANSITION = 1e-4

Memory = tuple[float, ...]

#: `friction` laws are summed for the `friction_torque` channel and for `modifier`s, which multiply that
#: sum; a `drive` law changes the commanded torque; a `load` is any other force.
Role = Literal["friction", "modifier", "drive", "load"]


@dataclass(slots=True)
class Instant:
    """The state of one joint now, and at the last accepted instant `step` earlier.

    Attributes:
        time: [s].
        step: since the last accepted instant [s]; 0 at the start.
        position, velocity: [rad or m, per s].
        command: commanded actuator torque [N m or N].
        friction: sum of the friction laws [N m or N]; modifiers only.
        last_velocity, last_command: at the last accepted instant.
        load: friction moment W of the joint's bearing [N m]; zero where nothing depends on it.
        last_load: at the last accepted instant.
        temperature: of the joint [K].
        static_factor, kinetic_factor: temperature factors of static and of kinetic friction [-].
        direction: sliding direction where it is not determined by the velocity: -1, 0 or 1.
    """

    time: float
    step: float
    position: float
    velocity: float
    command: float
    friction: float
    last_velocity: float
    last_command: float
    load: float = 0.0
    last_load: float = 0.0
    direction: float | None = None
    temperature: float = 293.15
    static_factor: float = 1.0
    kinetic_factor: float = 1.0

    @property
    def sign(self) -> float:
        """sgn(velocity), smoothed unless the direction is given."""
        return smooth_sign(self.velocity) if self.direction is None else self.direction


@dataclass(frozen=True)
class JointLaw(ABC):
    """Base of the laws; parameters are the fields of the concrete class, in SI units."""

    role: ClassVar[Role] = "load"
    #: The law has a memory; `initial` gives the first.
    remembers: ClassVar[bool] = True

    @property
    def needs_load(self) -> bool:
        """Whether the law depends on the load of the joint's bearing."""
        return False

    @abstractmethod
    def initial(self, now: Instant) -> Memory:
        """Initial memory."""

    @abstractmethod
    def advance(self, now: Instant, memory: Memory) -> tuple[float, Memory]:
        """Generalised force now [N m or N], and the memory if this instant is accepted."""


@dataclass(frozen=True)
class Momentary(JointLaw):
    """Base of the laws without memory."""

    remembers = False

    @abstractmethod
    def force(self, now: Instant) -> float:
        """Generalised force now [N m or N]."""

    def initial(self, now: Instant) -> Memory:
        return ()

    def advance(self, now: Instant, memory: Memory) -> tuple[float, Memory]:
        return self.force(now), memory


def smooth_sign(velocity: float) -> float:
    """sgn(v) as tanh(v / TRANSITION)."""
    return tanh(velocity / TRANSITION)
