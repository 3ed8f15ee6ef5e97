"""A flexible beam by its modes in a floating frame: Exudyn's `ObjectFFRFreducedOrder`.

Its mesh has displacements only. Each node of the finite elements therefore becomes seven mesh points: itself,
and six that stand out from it along its principal axes and turn with it, with masses that give its rotary
inertia exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import exudyn.FEM
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from exudyn_model.beam import Node, Shapes, beam_nodes, beam_shapes, damping_of
from exudyn_model.mechanism import Mass, PointMass
from exudyn_model.redundant.bodies import Body, Place, add_mass, held_at, node_at
from exudyn_model.redundant.grip import Grip, ModalGrip, add_modal_weight
from exudyn_model.redundant.handles import Seat
from exudyn_model.redundant.parts import Pose
from exudyn_model.rotation import skew
from robot_model import Beam, InputError

__all__ = ["ModalBeam"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
items: Any = exudyn.itemInterface

#: Share of a node's mass in each of the six points around it: with 1/12 half of it stays at the node.
OUTRIGGER_SHARE = 1 / 12
#: Relative to the largest moment: what rounding leaves of one that is zero.
NO_MOMENT = 1e-12


class ModalBeam(Body):
    """A beam by its modes in a floating frame, with its rigid hub.

    Points on its nodes load the modes that it has without them.
    """

    def __init__(
        self,
        mbs: Any,
        beam: Beam,
        hub: Mass,
        pose: Pose,
        *,
        gravity: Array,
        points: Sequence[PointMass] = (),
    ) -> None:
        self.beam, self.shapes = beam, beam_shapes(beam)
        self._nodes = beam_nodes(beam)
        fem = _mesh(self._nodes, self.shapes, points)
        form = exudyn.FEM.ObjectFFRFreducedOrderInterface(fem, roundMassMatrix=0, roundStiffnessMatrix=0)
        form.stiffnessMatrixReduced = np.diag(self.shapes.frequencies**2)
        made = form.AddObjectFFRFreducedOrder(
            mbs,
            positionRef=pose.position,
            initialVelocity=pose.velocity,
            rotationMatrixRef=pose.rotation,
            initialAngularVelocity=pose.rotation @ pose.omega,
        )
        self.node, self.modal = int(made["nRigidBody"]), int(made["nGenericODE2"])
        self.number = made["oFFRFreducedOrder"]
        masses, places = fem.massMatrix.diagonal()[::3], fem.nodes["Position"]
        moved = fem.modeBasis["matrix"].reshape(len(masses), 3, -1)
        moments = masses @ places, np.tensordot(masses, moved, axes=1)
        add_modal_weight(mbs, (self.node, self.modal), float(masses.sum()), moments, gravity)
        self.damping = damping_of(beam, self.shapes.frequencies)
        if self.damping.any():
            # Beside the body: its own damping matrix is made of Rayleigh's two figures only.
            mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=[self.modal], dampingMatrix=self.damping))
        if hub.mass > 0 or hub.inertia.any():
            add_mass(mbs, self.node, hub, gravity=gravity)

    @property
    def frames(self) -> tuple[int, ...]:
        return (self.node,)

    def elastic_energy(self, coordinates: Callable[[int], Array]) -> float:
        return 0.5 * float(self.shapes.frequencies**2 @ coordinates(self.modal) ** 2)

    @property
    def tip(self) -> int:
        """Mesh point of the tip."""
        return 7 * (len(self._nodes) - 1)

    def grip(self, point: Array) -> Grip:
        index = node_at(self._nodes, point)
        return ModalGrip(
            (self.node, self.modal), self._nodes[index].position, self.shapes.translations[index]
        )

    def place(self, mbs: Any, origin: Array, turn: Array) -> Place:
        index = node_at(self._nodes, origin)
        still, straight = np.zeros(3), np.eye(3)
        if index == 0 and self.beam.boundary == "clamped":
            marker = mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=self.node, localHT=held_at(turn)))
            return Place(marker, (self.node,), Seat(0, straight, still, origin, turn))
        raise InputError(
            "a joint on the deforming part of a modal body: the angular velocity that Exudyn's marker gives "
            "there is in the axes of the undeformed body, so that such joints drift apart; run it with "
            'flexible = "beam" and clamped modes.'
        )


def _mesh(nodes: Sequence[Node], shapes: Shapes, points: Sequence[PointMass]) -> Any:
    """The points of a modal body, and of what sits on its nodes, as Exudyn's finite-element interface."""
    positions, masses, modes = [], [], []
    for k, node in enumerate(nodes):
        own, each = _outriggers(node)
        for arm, mass in zip([np.zeros(3), *own], [node.mass - 6 * each, *[each] * 6]):
            positions.append(node.position + arm)
            masses.append(mass)
            modes.append(shapes.translations[k] - skew(arm) @ shapes.rotations[k])
    for point in points:
        k = node_at(nodes, point.place)
        positions.append(point.place)
        masses.append(point.mass)
        modes.append(shapes.translations[k] - skew(point.place - nodes[k].position) @ shapes.rotations[k])
    fem = exudyn.FEM.FEMinterface()
    fem.nodes = {"Position": np.array(positions)}
    diagonal = np.repeat(masses, 3)
    fem.massMatrix = sparse.csr_matrix(sparse.diags(diagonal))
    fem.stiffnessMatrix = sparse.csr_matrix((len(diagonal), len(diagonal)))
    fem.modeBasis = {"matrix": np.vstack(modes), "type": "NormalModes"}
    return fem


def _outriggers(node: Node) -> tuple[Array, float]:
    """Arms of six points around a node, shape (6, 3) [m], and the mass of each [kg].

    Two at +-a_i along each principal axis give second moments 2 mu a_i^2 = (J_j + J_k - J_i) / 2.
    """
    moments, axes = np.linalg.eigh(node.inertia)
    second = 0.5 * moments.sum() - moments
    if second.min() < -NO_MOMENT * max(float(moments[-1]), 1.0):
        raise InputError("a tip's moments of inertia break the triangle inequality; no body has such.")
    mass = OUTRIGGER_SHARE * node.mass
    if mass == 0:
        mass = float(moments.sum())  # of a massless node with inertia; its own point then takes it off again
    arms = (axes * np.sqrt(np.maximum(second, 0.0) / (2 * mass))).T
    return np.array([sign * arm for arm in arms for sign in (1.0, -1.0)]), mass
