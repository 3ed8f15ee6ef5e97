"""Bodies in Exudyn: rigid ones, modal ones in a floating frame, and geometrically exact beams.

A modal body is an `ObjectFFRFreducedOrder`, whose mesh has displacements only. Each node of the finite
elements therefore becomes seven mesh points: itself, and six that stand out from it along its principal axes
and turn with it, with masses that give its rotary inertia exactly. They also carry the rotation that a joint
on the node feels.

A beam is a chain of `ObjectBeamGeometricallyExact`: large rotations, nothing left out. Its stiffness against
shear is 12 EI / h^2, with which the two-node element with constant strain has the Euler-Bernoulli stiffness
of the cubic element exactly (MacNeal, Computers and Structures 8 (1978) 175-183), so that small deflections
and lumped masses are those of the modal body.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import exudyn
import exudyn.FEM
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial.transform import Rotation

from exudyn_model.mechanism import Mass
from exudyn_model.beam import Node, Shapes, beam_nodes, beam_shapes, damping_of
from exudyn_model.redundant.handles import Seat, from_euler, node_coordinates
from exudyn_model.redundant.parts import Part, Pose
from exudyn_model.rotation import skew, turning_rate
from robot_model import Beam, InputError

__all__ = ["Body", "ExactBeam", "Ground", "ModalBeam", "Place", "RigidBody", "make_body"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
exu: Any = exudyn
items: Any = exudyn.itemInterface

#: Share of a node's mass in each of the six points around it: with 1/12 half of it stays at the node.
OUTRIGGER_SHARE = 1 / 12
#: Relative to the largest moment: what rounding leaves of one that is zero.
NO_MOMENT = 1e-12
#: How far from a node of a beam a joint may sit, relative to its length.
NODE_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Place:
    """Where a joint holds a body.

    Attributes:
        marker: Exudyn's number.
        turn: the joint's axes in the marker's, shape (3, 3).
        nodes: Exudyn's nodes that move it; empty on the ground.
        seat: as a `Seat` whose coordinates begin at 0 with the first of `nodes`.
    """

    marker: int
    turn: Array
    nodes: tuple[int, ...]
    seat: Seat


class Body(ABC):
    """One body in the system."""

    #: Node of its frame; None on the ground.
    node: int | None = None

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
        marker = mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=self._number, localPosition=origin))
        return Place(marker, turn, (), Seat(None, self._pose.rotation, self._pose.position, origin, turn))


class RigidBody(Body):
    """A rigid body whose node is its frame."""

    def __init__(self, mbs: Any, mass: Mass, pose: Pose, *, gravity: Array) -> None:
        self.node = _add_node(mbs, pose)
        self._number = _add_mass(mbs, self.node, mass, gravity=gravity)

    def place(self, mbs: Any, origin: Array, turn: Array) -> Place:
        marker = mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=self._number, localPosition=origin))
        return Place(marker, turn, (self.node,), Seat(0, np.eye(3), np.zeros(3), origin, turn))


class ModalBeam(Body):
    """A beam by its modes in a floating frame, with its rigid hub."""

    def __init__(self, mbs: Any, beam: Beam, hub: Mass, pose: Pose, *, gravity: Array) -> None:
        self.beam, self.shapes = beam, beam_shapes(beam)
        self._nodes = beam_nodes(beam)
        fem, arms = _mesh(self._nodes, self.shapes)
        self._arms = arms
        form = exudyn.FEM.ObjectFFRFreducedOrderInterface(fem, roundMassMatrix=0, roundStiffnessMatrix=0)
        form.stiffnessMatrixReduced = np.diag(self.shapes.frequencies**2)
        made = form.AddObjectFFRFreducedOrder(
            mbs,
            positionRef=pose.position,
            initialVelocity=pose.velocity,
            rotationMatrixRef=pose.rotation,
            initialAngularVelocity=pose.rotation @ pose.omega,
            gravity=gravity,
        )
        self.node, self.modal = made["nRigidBody"], made["nGenericODE2"]
        self.number = made["oFFRFreducedOrder"]
        self.damping = damping_of(beam, self.shapes.frequencies)
        if self.damping.any():
            # Beside the body: its own damping matrix is made of Rayleigh's two figures only.
            mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=[self.modal], dampingMatrix=self.damping))
        if hub.mass > 0 or hub.inertia.any():
            _add_mass(mbs, self.node, hub, gravity=gravity)

    @property
    def tip(self) -> int:
        """Mesh point of the tip."""
        return 7 * (len(self._nodes) - 1)

    def place(self, mbs: Any, origin: Array, turn: Array) -> Place:
        index = _node_at(self._nodes, origin)
        still, straight = np.zeros(3), np.eye(3)
        if index == 0 and self.beam.boundary == "clamped":
            marker = mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=self.node))
            return Place(marker, turn, (self.node,), Seat(0, straight, still, origin, turn))
        marker = mbs.AddMarker(
            items.MarkerSuperElementRigid(
                bodyNumber=self.number,
                meshNodeNumbers=[7 * index + k for k in range(1, 7)],
                weightingFactors=[1 / 6] * 6,
            )
        )
        count = len(self.shapes.frequencies)
        phi, psi = self.shapes.translations[index], self.shapes.rotations[index]
        seat = Seat(0, straight, still, self._nodes[index].position, turn, (7, 7 + count), phi, psi)
        return Place(marker, turn, (self.node, self.modal), seat)


class ExactBeam(Body):
    """A beam of geometrically exact elements; the body's frame is that of the root."""

    def __init__(self, mbs: Any, beam: Beam, hub: Mass, pose: Pose, *, gravity: Array) -> None:
        self.beam, self._nodes = beam, beam_nodes(beam)
        self.nodes = [_add_node(mbs, self._posed(node, pose)) for node in self._nodes]
        self.node = self.nodes[0]
        section = _section(beam)
        self._h = h = beam.length / beam.elements
        for first, second in zip(self.nodes, self.nodes[1:]):
            mbs.AddObject(
                items.ObjectBeamGeometricallyExact(
                    nodeNumbers=[first, second], physicsLength=h, sectionData=section
                )
            )
        self._damp(mbs, h)
        tip = Mass(
            beam.tip.mass, np.zeros(3), np.diag(np.asarray(beam.tip.inertia, dtype=float))
        )
        if tip.mass > 0 or tip.inertia.any():
            _add_mass(mbs, self.nodes[-1], tip, gravity=np.zeros(3))
        turned = Mass(hub.mass, beam.axes.T @ hub.first_moment, beam.axes.T @ hub.inertia @ beam.axes)
        if hub.mass > 0 or hub.inertia.any():
            _add_mass(mbs, self.node, turned, gravity=gravity)
        if gravity.any():
            for number, node in zip(self.nodes, self._nodes):
                marker = mbs.AddMarker(items.MarkerNodePosition(nodeNumber=number))
                mbs.AddLoad(items.LoadForceVector(markerNumber=marker, loadVector=node.mass * gravity))

    def strains(self, nodes: Sequence[Array]) -> list[float]:
        """Of the gauges: stretch and curvature of their element, constant along it, from nodes' coordinates."""
        found = []
        for gauge in self.beam.gauges:
            k = min(int(gauge.place / self._h), self.beam.elements - 1)
            strain = self._element_strain(nodes[k], nodes[k + 1])
            normal = np.asarray(gauge.normal) / np.linalg.norm(gauge.normal)
            # v'' is the curvature about z, w'' minus that about y.
            found.append(strain[0] - gauge.distance * (normal[0] * strain[5] - normal[1] * strain[4]))
        return found

    def elastic_energy(self, nodes: Sequence[Array]) -> float:
        """From the coordinates of the nodes [J]."""
        stiffness = np.diag(np.asarray(_section(self.beam).stiffnessMatrix))
        strains = [self._element_strain(*pair) for pair in zip(nodes, nodes[1:])]
        return float(sum(0.5 * self._h * stiffness @ strain**2 for strain in strains))

    def _element_strain(self, first: Array, second: Array) -> Array:
        """Stretch, two shears, twist and two curvatures: the screw from node to node over the length, less 1.

        The logarithm of SE(3): rotation vector r and displacement T(r)^-T d of the relative motion (Sonneville,
        Cardona, Brüls, CMAME 268 (2014) 451-474, eq. 24).
        """
        turn = from_euler(first[3:7])
        relative = turn.T @ from_euler(second[3:7])
        rotation = Rotation.from_matrix(relative).as_rotvec()
        moved = np.linalg.solve(turning_rate(rotation), turn.T @ (second[:3] - first[:3]))
        strain = np.concatenate([moved, rotation]) / self._h
        strain[0] -= 1.0
        return strain

    def _posed(self, node: Node, pose: Pose) -> Pose:
        swing = np.cross(pose.omega, node.position)
        return Pose(
            pose.rotation @ self.beam.axes,
            pose.position + pose.rotation @ node.position,
            pose.velocity + pose.rotation @ swing,
            self.beam.axes.T @ pose.omega,
        )

    def _damp(self, mbs: Any, h: float) -> None:
        """Dampers in parallel to bending and torsion, b EI / h between neighbouring nodes.

        b follows from `rayleigh`, or from the damping ratio of the first mode, 2 zeta / w.
        """
        beam = self.beam
        if beam.rayleigh is not None:
            if beam.rayleigh[0]:
                raise InputError(
                    "a geometrically exact beam has no damping in proportion to its mass; set the first "
                    "figure of rayleigh to 0, or use the modal form."
                )
            factor = beam.rayleigh[1]
        else:
            ratio = beam.damping_ratio[0] if isinstance(beam.damping_ratio, tuple) else beam.damping_ratio
            factor = 2 * ratio / float(beam_shapes(beam).frequencies[0]) if ratio else 0.0
        if factor == 0.0:
            return
        _, torsion, second_y, second_z = beam.section.figures
        stiffness = [beam.shear * torsion, beam.young * second_y, beam.young * second_z]
        damping = np.diag([0.0, 0.0, 0.0, *(factor * k / h for k in stiffness)])
        markers = [mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=node)) for node in self.nodes]
        for pair in zip(markers, markers[1:]):
            mbs.AddObject(
                items.ObjectConnectorRigidBodySpringDamper(markerNumbers=list(pair), damping=damping)
            )

    def place(self, mbs: Any, origin: Array, turn: Array) -> Place:
        node = self.nodes[_node_at(self._nodes, origin)]
        own = self.beam.axes.T @ turn
        marker = mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=node))
        return Place(marker, own, (node,), Seat(0, np.eye(3), np.zeros(3), np.zeros(3), own))


def make_body(mbs: Any, part: Part, pose: Pose, *, gravity: Array, flexible: str, fixed: bool) -> Body:
    """The part in the system; `flexible` is "modal" or "beam"."""
    if fixed:
        return Ground(mbs, pose)
    if part.link is None:
        return RigidBody(mbs, part.mass, pose, gravity=gravity)
    beam = part.link.beam
    if beam is None:
        raise InputError(
            f"link '{part.name}': the Exudyn engine carries beams only; imported finite elements run in the "
            "reference engine."
        )
    if flexible == "beam":
        return ExactBeam(mbs, beam, part.mass, pose, gravity=gravity)
    if beam.stiffening:
        raise InputError(
            f"link '{part.name}': Exudyn's modal bodies know no geometric stiffening; set stiffening to "
            'false, or run it with flexible = "beam".'
        )
    return ModalBeam(mbs, beam, part.mass, pose, gravity=gravity)


def _add_node(mbs: Any, pose: Pose) -> int:
    x, v = node_coordinates(pose.rotation, pose.position, pose.velocity, pose.omega)
    return int(mbs.AddNode(items.NodeRigidBodyEP(referenceCoordinates=x, initialVelocities=v)))


def _add_mass(mbs: Any, node: int, mass: Mass, *, gravity: Array) -> int:
    j = mass.inertia
    number = mbs.AddObject(
        items.ObjectRigidBody(
            nodeNumber=node,
            physicsMass=mass.mass,
            physicsCenterOfMass=mass.center,
            physicsInertia=[j[0, 0], j[1, 1], j[2, 2], j[1, 2], j[0, 2], j[0, 1]],
        )
    )
    if gravity.any() and mass.mass > 0:
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=number))
        mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=gravity))
    return int(number)


def _node_at(nodes: Sequence[Node], origin: Array) -> int:
    return int(np.argmin([np.linalg.norm(node.position - origin) for node in nodes]))


def _section(beam: Beam) -> Any:
    area, torsion, second_y, second_z = beam.section.figures
    h = beam.length / beam.elements
    bending_y, bending_z = beam.young * second_y, beam.young * second_z
    section = exu.BeamSection()
    section.stiffnessMatrix = np.diag(
        [
            beam.young * area,
            12 * bending_z / h**2,
            12 * bending_y / h**2,
            beam.shear * torsion,
            bending_y,
            bending_z,
        ]
    )
    per_length = beam.density * area
    swing = per_length * h**2 / 12
    turning = beam.density * np.array([second_y + second_z, second_y, second_z])
    section.massPerLength = per_length
    section.inertia = np.diag(turning + [0.0, swing, swing])
    return section


def _mesh(nodes: Sequence[Node], shapes: Shapes) -> tuple[Any, Array]:
    """The points of a modal body as Exudyn's finite-element interface, and the arms of each node's six."""
    positions, masses, modes, arms = [], [], [], []
    for k, node in enumerate(nodes):
        own, each = _outriggers(node)
        arms.append(own)
        for arm, mass in zip([np.zeros(3), *own], [node.mass - 6 * each, *[each] * 6]):
            positions.append(node.position + arm)
            masses.append(mass)
            modes.append(shapes.translations[k] - skew(arm) @ shapes.rotations[k])
    fem = exudyn.FEM.FEMinterface()
    fem.nodes = {"Position": np.array(positions)}
    diagonal = np.repeat(masses, 3)
    fem.massMatrix = sparse.csr_matrix(sparse.diags(diagonal))
    fem.stiffnessMatrix = sparse.csr_matrix((len(diagonal), len(diagonal)))
    fem.modeBasis = {"matrix": np.vstack(modes), "type": "NormalModes"}
    return fem, np.array(arms)


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

