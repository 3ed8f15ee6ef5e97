"""Rigid bodies in Exudyn, and the interface of all bodies for joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.beam import Node
from exudyn_model.bodies.mechanism import Mass
from exudyn_model.redundant.bodies.grip import Grip, RigidGrip
from exudyn_model.redundant.bodies.handles import Seat, node_coordinates
from exudyn_model.redundant.bodies.parts import Pose

__all__ = ["Body", "Ground", "Place", "RigidBody", "add_mass", "add_node", "held_at", "node_at"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
exu: Any = exudyn
items: Any = exudyn.itemInterface


@dataclass(frozen=True)
class Place:
    """Attachment of a joint to a body.

    Attributes:
        marker: Exudyn's number; it has the joint's axes.
        nodes: Exudyn's nodes that move it; empty on the ground.
        seat: as a `Seat` whose coordinates begin at 0 with the first of `nodes`.
    """

    marker: int
    nodes: tuple[int, ...]
    seat: Seat


class Body(ABC):
    """One body in the system."""

    @property
    def frames(self) -> tuple[int, ...]:
        """Exudyn's nodes that turn, its own frame's first; none on the ground."""
        return ()

    def elastic_energy(self, coordinates: Callable[[int], Array]) -> float:
        """Energy of its deformation [J]; `coordinates` gives those of a node."""
        return 0.0

    @abstractmethod
    def grip(self, point: Array, turn: Array) -> Grip | None:
        """Attachment of a force at `point` of the body's frame; None if the body is fixed.

        Its axes are `turn` in that frame; on a flexible body, those of the frame.
        """

    def root(self, mbs: Any, turn: Array) -> Place:
        """A marker at the body's inboard joint, with axes `turn` in its frame."""
        return self.place(mbs, np.zeros(3), turn)

    @abstractmethod
    def place(self, mbs: Any, origin: Array, turn: Array) -> Place:
        """A marker at `origin` of the body's frame for a joint with axes `turn` in it."""


class Ground(Body):
    """The base that does not move."""

    def __init__(self, mbs: Any, pose: Pose) -> None:
        self._pose = pose
        self._number = mbs.AddObject(
            items.ObjectGround(referencePosition=pose.position, referenceRotation=pose.rotation)
        )

    def place(self, mbs: Any, origin: Array, turn: Array) -> Place:
        marker = mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=self._number, localHT=held_at(turn, origin)))
        return Place(marker, (), Seat(None, self._pose.rotation, self._pose.position, origin, turn))

    def grip(self, point: Array, turn: Array) -> Grip | None:
        return None


class RigidBody(Body):
    """A rigid body whose node is its frame."""

    def __init__(self, mbs: Any, mass: Mass, pose: Pose, *, gravity: Array) -> None:
        self.node: int = add_node(mbs, pose)
        self._number = add_mass(mbs, self.node, mass, gravity=gravity)

    @property
    def frames(self) -> tuple[int, ...]:
        return (self.node,)

    def place(self, mbs: Any, origin: Array, turn: Array) -> Place:
        marker = mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=self._number, localHT=held_at(turn, origin)))
        return Place(marker, (self.node,), Seat(0, np.eye(3), np.zeros(3), origin, turn))

    def grip(self, point: Array, turn: Array) -> Grip | None:
        return RigidGrip((self.node,), point, turn)


def held_at(turn: Array, origin: Array | None = None) -> Any:
    """The joint's axes and place in a marker's body, in Exudyn's format."""
    return exu.HT(rotation=turn, translation=np.zeros(3) if origin is None else origin)


def add_node(mbs: Any, pose: Pose) -> int:
    x, v = node_coordinates(pose.rotation, pose.position, pose.velocity, pose.omega)
    return int(mbs.AddNode(items.NodeRigidBodyEP(referenceCoordinates=x, initialVelocities=v)))


def add_mass(mbs: Any, node: int, mass: Mass, *, gravity: Array) -> int:
    j = mass.inertia
    number = mbs.AddObject(
        items.ObjectRigidBody(
            nodeNumber=node,
            mass=mass.mass,
            centerOfMass=mass.center,
            inertia=[j[0, 0], j[1, 1], j[2, 2], j[1, 2], j[0, 2], j[0, 1]],
        )
    )
    if gravity.any() and mass.mass > 0:
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=number))
        mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=gravity))
    return int(number)


def node_at(nodes: Sequence[Node], origin: Array) -> int:
    """The node nearest to a place."""
    return int(np.argmin([np.linalg.norm(node.position - origin) for node in nodes]))
