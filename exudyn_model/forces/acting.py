"""What forces on joints and motors are at one instant, and what of it is remembered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from exudyn_model.effects.base import Memory

__all__ = ["JointForces", "LawMemories", "Remembered", "Stopping"]


@dataclass(slots=True)
class JointForces:
    """Forces at one instant, per moving joint in the order of the file [N m or N].

    Attributes:
        command: commanded torque of the drives, within their actuators' limits.
        friction: of the friction laws and their modifiers, those at motors of transmissions included.
        total: everything that acts on the coordinate.
        wrench: of the controller on a held base, force and moment about its origin in base axes [N, N m];
            empty otherwise.
        motors: everything that acts on each motor that moves by itself.
        gears: what the gear of each of them transmits.
        rubbing: friction of the joint itself and of a motor that moves it alone.
    """

    command: list[float]
    friction: list[float]
    total: list[float]
    wrench: list[float] = field(default_factory=list)
    motors: list[float] = field(default_factory=list)
    gears: list[float] = field(default_factory=list)
    rubbing: list[float] = field(default_factory=list)

    @property
    def every(self) -> list[float]:
        """On all joints and then on all motors that move by themselves."""
        return [*self.total, *self.motors]


@dataclass(frozen=True)
class Stopping:
    """What friction does over a step, decided at its beginning.

    Attributes:
        direction: in which every joint slides, 1 or -1, or 0 for one that is being stopped or rests.
        force: of the friction on the latter, over and above what its laws give without a direction [N m or
        N].
    """

    direction: Sequence[float]
    force: Sequence[float]


@dataclass(frozen=True)
class LawMemories:
    """What laws at joints, and at motors of transmissions by drive, would remember."""

    at_joints: list[list[Memory]]
    at_motors: dict[int, list[Memory]]


class Remembered:
    """What was true at the last accepted instant."""

    def __init__(self, joints: int) -> None:
        self.time = 0.0
        self.velocity = [0.0] * joints
        self.command = [0.0] * joints
        self.errors = [0.0] * joints
        self.integral = [0.0] * joints
        self.output: list[float] | None = None
        self.loads = [0.0] * joints
        self.laws: list[list[Memory]] = [[] for _ in range(joints)]
        self.at_motors: dict[int, list[Memory]] = {}
        self.extra: list[Memory] = []
        self.gears: list[Memory] = []
        self.motor_velocity: list[float] = []
