"""A point mass on springs in a frame of its own: one mesh point of Exudyn's `ObjectFFRFreducedOrder`."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

import exudyn.FEM
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from exudyn_model.mechanism import Mass
from exudyn_model.redundant.bodies import Body, Place, add_mass, held_at
from exudyn_model.redundant.grip import Grip, ModalGrip, add_modal_weight
from exudyn_model.redundant.handles import Seat
from exudyn_model.redundant.parts import Pose
from robot_model import SprungMass

__all__ = ["SprungBody"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
items: Any = exudyn.itemInterface


class SprungBody(Body):
    """A frame that a joint holds, with its rigid hub and the mass on springs at its origin.

    The three modal coordinates are the mass's displacements along the frame's axes, times sqrt(mass).
    """

    def __init__(self, mbs: Any, sprung: SprungMass, hub: Mass, pose: Pose, *, gravity: Array) -> None:
        self.frequency = 2 * pi * sprung.frequency
        self.shape = np.eye(3) / np.sqrt(sprung.mass)
        fem = exudyn.FEM.FEMinterface()
        fem.nodes = {"Position": np.zeros((1, 3))}
        fem.massMatrix = sparse.csr_matrix(sprung.mass * np.eye(3))
        fem.stiffnessMatrix = sparse.csr_matrix((3, 3))
        fem.modeBasis = {"matrix": self.shape, "type": "NormalModes"}
        form = exudyn.FEM.ObjectFFRFreducedOrderInterface(fem, roundMassMatrix=0, roundStiffnessMatrix=0)
        form.stiffnessMatrixReduced = self.frequency**2 * np.eye(3)
        made = form.AddObjectFFRFreducedOrder(
            mbs,
            positionRef=pose.position,
            initialVelocity=pose.velocity,
            rotationMatrixRef=pose.rotation,
            initialAngularVelocity=pose.rotation @ pose.omega,
        )
        self.node, self.modal = int(made["nRigidBody"]), int(made["nGenericODE2"])
        self.number = made["oFFRFreducedOrder"]
        moments = np.zeros(3), sprung.mass * self.shape
        add_modal_weight(mbs, (self.node, self.modal), sprung.mass, moments, gravity)
        if sprung.damping_ratio:
            damping = 2 * sprung.damping_ratio * self.frequency * np.eye(3)
            mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=[self.modal], dampingMatrix=damping))
        if hub.mass > 0 or hub.inertia.any():
            add_mass(mbs, self.node, hub, gravity=gravity)

    @property
    def frames(self) -> tuple[int, ...]:
        return (self.node,)

    def elastic_energy(self, coordinates: Callable[[int], Array]) -> float:
        return 0.5 * self.frequency**2 * float(np.sum(coordinates(self.modal) ** 2))

    def place(self, mbs: Any, origin: Array, turn: Array) -> Place:
        marker = mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=self.node, localHT=held_at(turn, origin)))
        return Place(marker, (self.node,), Seat(0, np.eye(3), np.zeros(3), origin, turn))

    def grip(self, point: Array) -> Grip:
        return ModalGrip((self.node, self.modal), np.zeros(3), self.shape)
