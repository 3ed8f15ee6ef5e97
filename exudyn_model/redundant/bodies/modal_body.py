"""A flexible body by its modes in a floating frame: Exudyn's `ObjectFFRFreducedOrder`.

Its mesh has displacements only: rotary inertia is represented by points around the nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import exudyn.FEM
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from exudyn_model.bodies.flexible_link import FlexibleLink
from exudyn_model.bodies.mechanism import Mass, PointMass
from exudyn_model.bodies.moments import Points, Surplus, moments_of
from exudyn_model.bodies.rotation import skew
from exudyn_model.redundant.bodies.grip import Grip, ModalGrip
from exudyn_model.redundant.bodies.handles import Seat
from exudyn_model.redundant.bodies.parts import Bending, Pose, at_node
from exudyn_model.redundant.bodies.rigid import Body, Place, add_mass, add_node, held_at
from exudyn_model.redundant.bodies.surplus import add_modal_weight, add_surplus
from exudyn_model.redundant.bodies.weld import add_weld

__all__ = ["ModalBody"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
items: Any = exudyn.itemInterface


class ModalBody(Body):
    """A flexible link by its modes in a floating frame, with its rigid hub.

    Points on its nodes load the modes of the body without them. A joint on a node that moves in the frame is
    attached to a massless Exudyn node that is welded there.
    """

    def __init__(
        self,
        mbs: Any,
        link: FlexibleLink,
        hub: Mass,
        pose: Pose,
        *,
        gravity: Array,
        points: Sequence[PointMass] = (),
        start: Bending | None = None,
    ) -> None:
        self.link, self._pose = link, pose
        self._start = start or (np.zeros(link.count), np.zeros(link.count))
        loaded, surplus = _loaded(link, points)
        fem = _mesh(loaded)
        form = exudyn.FEM.ObjectFFRFreducedOrderInterface(fem, roundMassMatrix=0, roundStiffnessMatrix=0)
        form.stiffnessMatrixReduced = np.diag(link.shapes.frequencies**2)
        made = form.AddObjectFFRFreducedOrder(
            mbs,
            positionRef=pose.position,
            initialVelocity=pose.velocity,
            rotationMatrixRef=pose.rotation,
            initialAngularVelocity=pose.rotation @ pose.omega,
        )
        self.node, self.modal = int(made["nRigidBody"]), int(made["nGenericODE2"])
        self.number = made["oFFRFreducedOrder"]
        if surplus:
            add_surplus(mbs, (self.node, self.modal), surplus)
        moments, none = moments_of(loaded), Surplus.none(link.count)
        add_modal_weight(mbs, (self.node, self.modal), moments, surplus or none, gravity)
        if link.damping.any():
            # A separate object, since the body's own damping is limited to Rayleigh's two coefficients.
            mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=[self.modal], dampingMatrix=link.damping))
        if hub.mass > 0 or hub.inertia.any():
            add_mass(mbs, self.node, hub, gravity=gravity)
        self._held: dict[int, int] = {}
        self.welds: list[Any] = []

    @property
    def frames(self) -> tuple[int, ...]:
        return (self.node, *self._held.values())

    def elastic_energy(self, coordinates: Callable[[int], Array]) -> float:
        return 0.5 * float(self.link.shapes.frequencies**2 @ coordinates(self.modal) ** 2)

    def grip(self, point: Array, turn: Array) -> Grip:
        return ModalGrip((self.node, self.modal), self.link, self.link.nearest(point))

    def root(self, mbs: Any, turn: Array) -> Place:
        if not self.link.moves(self.link.root):
            return self._on_frame(mbs, np.zeros(3), turn)
        return self._at(mbs, self.link.root, turn)

    def place(self, mbs: Any, origin: Array, turn: Array) -> Place:
        if self.link.rigid_frame:
            return self._on_frame(mbs, origin, turn)
        return self._at(mbs, self.link.node_at(origin), turn)

    def _at(self, mbs: Any, index: int, turn: Array) -> Place:
        if not self.link.moves(index):
            return self._on_frame(mbs, self.link.nodes[index], turn)
        if index not in self._held:
            self._held[index] = add_node(mbs, at_node(self._pose, self.link.motion(index, *self._start)))
            self.welds.append(add_weld(mbs, self.number, self._held[index], self.link, index))
        node = self._held[index]
        marker = mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=node, localHT=held_at(turn)))
        return Place(marker, (node,), Seat(0, np.eye(3), np.zeros(3), np.zeros(3), turn))

    def _on_frame(self, mbs: Any, origin: Array, turn: Array) -> Place:
        marker = mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=self.node, localHT=held_at(turn, origin)))
        return Place(marker, (self.node,), Seat(0, np.eye(3), np.zeros(3), origin, turn))


def _loaded(link: FlexibleLink, more: Sequence[PointMass]) -> tuple[Points, Surplus | None]:
    """The link's points with the masses on its nodes; and its surplus, including loads at their nodes."""
    own, surplus = link.points, link.surplus
    if not more:
        return own, surplus
    modes, nodes = [], [link.nearest(point.place) for point in more]
    for k, point in zip(nodes, more):
        arm = skew(point.place - link.nodes[k])
        modes.append(link.shapes.translations[k] - arm @ link.shapes.rotations[k])
    masses = np.array([point.mass for point in more])
    loaded = Points(
        np.vstack([own.places, [point.place for point in more]]),
        sparse.csr_array(sparse.block_diag([own.masses, sparse.diags_array(masses)])),
        np.concatenate([own.modes, modes]),
    )
    if surplus and link.shortened is not None:
        along = link.nodes[nodes] @ surplus.axis
        surplus = surplus.shortening(surplus.axis, masses, along, link.shortened[nodes])
    return loaded, surplus


def _mesh(points: Points) -> Any:
    """As Exudyn's finite-element interface."""
    fem = exudyn.FEM.FEMinterface()
    fem.nodes = {"Position": points.places}
    fem.massMatrix = sparse.csr_matrix(sparse.kron(points.masses, np.eye(3)))
    fem.stiffnessMatrix = sparse.csr_matrix(fem.massMatrix.shape)
    fem.modeBasis = {"matrix": points.modes.reshape(3 * len(points.places), -1), "type": "NormalModes"}
    return fem
