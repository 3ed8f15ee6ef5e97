"""Forces on joints and motors at one instant, and their memory."""

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
        total: sum of all forces on the coordinate.
        wrench: of the controller on a held base, force and moment about its origin in base axes [N, N m];
            empty otherwise.
        motors: sum of all forces on each motor with its own coordinate.
        gears: transmitted torque of the gear of each of them.
        rubbing: friction of the joint itself and of a motor that moves only this joint.
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
        """Forces on all joints and then on all motors with their own coordinate."""
        return [*self.total, *self.motors]


@dataclass(frozen=True)
class Stopping:
    """Friction over a step, decided at its beginning.

    Attributes:
        direction: sliding direction of every joint, 1 or -1, or 0 for one that is being stopped or rests.
        force: friction on the latter in addition to its laws without a direction [N m or N].
    """

    direction: Sequence[float]
    force: Sequence[float]


@dataclass(frozen=True)
class LawMemories:
    """Memories of laws at joints, and at motors of transmissions by drive."""

    at_joints: list[list[Memory]]
    at_motors: dict[int, list[Memory]]


class Remembered:
    """State and memories at the last accepted instant."""

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
