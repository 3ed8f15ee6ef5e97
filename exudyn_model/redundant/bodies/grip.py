"""Points of a body at which forces act: motion from Exudyn's coordinates, and forces on them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.flexible_link import FlexibleLink
from exudyn_model.bodies.rotation import cross, from_quaternion
from exudyn_model.effects.links.pushes import PointMotion, Push
from exudyn_model.redundant.bodies.handles import euler_rates

__all__ = ["Grip", "Gripped", "ModalGrip", "RigidGrip", "add_push"]

Array = NDArray[np.float64]
items: Any = exudyn.itemInterface


@dataclass(frozen=True)
class Grip(ABC):
    """A point of a body.

    Attributes:
        nodes: Exudyn's nodes that move it, the body's frame first.
    """

    nodes: tuple[int, ...]

    @abstractmethod
    def motion(self, time: float, x: Array, v: Array) -> PointMotion:
        """From the coordinates of its nodes and their rates."""

    @abstractmethod
    def spread(self, x: Array, force: Array, moment: Array) -> Array:
        """Generalised forces on the coordinates, of force and moment in the axes of the point."""


@dataclass(frozen=True)
class RigidGrip(Grip):
    """A point `lever` of a rigid frame, with axes `turn` in it."""

    lever: Array
    turn: Array

    def motion(self, time: float, x: Array, v: Array) -> PointMotion:
        frame, omega = from_quaternion(x[3:7]), euler_rates(x[3:7]) @ v[3:7]
        velocity = frame.T @ v[:3] + cross(omega, self.lever)
        back = self.turn.T
        return PointMotion(time, x[:3] + frame @ self.lever, frame @ self.turn, back @ velocity, back @ omega)

    def spread(self, x: Array, force: Array, moment: Array) -> Array:
        own = self.turn @ force
        about = self.turn @ moment + cross(self.lever, own)
        return np.concatenate([from_quaternion(x[3:7]) @ own, euler_rates(x[3:7]).T @ about])


@dataclass(frozen=True)
class ModalGrip(Grip):
    """A node of a modal body; axes are those of its frame."""

    link: FlexibleLink
    index: int

    def motion(self, time: float, x: Array, v: Array) -> PointMotion:
        frame, omega = from_quaternion(x[3:7]), euler_rates(x[3:7]) @ v[3:7]
        node = self.link.motion(self.index, x[7:], v[7:])
        velocity = frame.T @ v[:3] + cross(omega, node.place) + node.slides
        return PointMotion(time, x[:3] + frame @ node.place, frame, velocity, omega)

    def spread(self, x: Array, force: Array, moment: Array) -> Array:
        """Moments are not supported: no effect on a modal body has one."""
        node = self.link.motion(self.index, x[7:], np.zeros(self.link.count))
        turning = euler_rates(x[3:7]).T @ cross(node.place, force)
        return np.concatenate([from_quaternion(x[3:7]) @ force, turning, node.slide.T @ force])


class Gripped:
    """A force effect at a grip in a system."""

    def __init__(self, mbs: Any, push: Push, grip: Grip) -> None:
        self.push, self.grip = push, grip
        references = [mbs.GetNode(node)["referenceCoordinates"] for node in grip.nodes]
        self._reference = np.concatenate([np.asarray(part, dtype=float) for part in references])

    def force(self, time: float, q: Sequence[float], v: Sequence[float]) -> Array:
        """On the coordinates of the grip's nodes, at displacements `q` from their reference."""
        x = np.asarray(q) + self._reference
        at = self.grip.motion(time, x, np.asarray(v))
        return self.grip.spread(x, *self.push.wrench(at))


def add_push(mbs: Any, push: Push, grip: Grip) -> Gripped:
    """Put it into the system, before it is assembled."""
    made = Gripped(mbs, push, grip)
    mbs.AddObject(
        items.ObjectGenericODE2(
            nodeNumbers=list(grip.nodes),
            forceUserFunction=lambda _, t, item, q, v: made.force(t, q, v),
        )
    )
    return made
