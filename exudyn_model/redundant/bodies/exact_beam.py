"""A flexible beam without truncation: a chain of Exudyn's `ObjectBeamGeometricallyExact`.

Large rotations without truncation. Its shear stiffness is 12 EI / h^2, with which the two-node element
with constant strain has the Euler-Bernoulli stiffness of the cubic element exactly (MacNeal, Computers and
Structures 8 (1978) 175-183). Its mass is distributed instead of lumped: a second discretisation, which
converges to the modal form as the number of elements grows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import exudyn
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from exudyn_model.bodies.beam import Node, beam_nodes, beam_shapes
from exudyn_model.bodies.mechanism import Mass, PointMass
from exudyn_model.bodies.rotation import from_quaternion, skew, turning_rate
from exudyn_model.redundant.bodies.grip import Grip, RigidGrip
from exudyn_model.redundant.bodies.handles import Seat
from exudyn_model.redundant.bodies.parts import Pose
from exudyn_model.redundant.bodies.rigid import Body, Place, add_mass, add_node, held_at, node_at
from robot_model import Beam, InputError

__all__ = ["ExactBeam"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
exu: Any = exudyn
items: Any = exudyn.itemInterface


class ExactBeam(Body):
    """A beam of geometrically exact elements; the body's frame is that of the root."""

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
        self.beam, self._nodes = beam, beam_nodes(beam)
        self.nodes = [add_node(mbs, self._posed(node, pose)) for node in self._nodes]
        self.node: int = self.nodes[0]
        section = _section(beam)
        self._h = h = beam.length / beam.elements
        for first, second in pairwise(self.nodes):
            mbs.AddObject(
                items.ObjectBeamGeometricallyExact(nodeNumbers=[first, second], length=h, sectionData=section)
            )
        self._damp(mbs, h)
        tip = Mass(beam.tip.mass, np.zeros(3), np.diag(np.asarray(beam.tip.inertia, dtype=float)))
        if tip.mass > 0 or tip.inertia.any():
            add_mass(mbs, self.nodes[-1], tip, gravity=np.zeros(3))
        turned = Mass(hub.mass, beam.axes.T @ hub.first_moment, beam.axes.T @ hub.inertia @ beam.axes)
        if hub.mass > 0 or hub.inertia.any():
            add_mass(mbs, self.node, turned, gravity=gravity)
        for point in points:
            k = node_at(self._nodes, point.place)
            arm = beam.axes.T @ (point.place - self._nodes[k].position)
            carried = Mass(point.mass, point.mass * arm, -point.mass * skew(arm) @ skew(arm))
            add_mass(mbs, self.nodes[k], carried, gravity=gravity)
        if gravity.any():
            for number, node in zip(self.nodes, self._nodes):
                marker = mbs.AddMarker(items.MarkerNodePosition(nodeNumber=number))
                mbs.AddLoad(items.LoadForceVector(markerNumber=marker, loadVector=node.mass * gravity))

    @property
    def frames(self) -> tuple[int, ...]:
        return tuple(self.nodes)

    def strains(self, nodes: Sequence[Array]) -> list[float]:
        """Of the gauges, from the coordinates of all nodes: strain is constant along an element."""
        found = []
        for gauge in self.beam.gauges:
            k = min(int(gauge.place / self._h), self.beam.elements - 1)
            strain = self._element_strain(nodes[k], nodes[k + 1])
            normal = np.asarray(gauge.normal) / np.linalg.norm(gauge.normal)
            # v'' is the curvature about z, w'' minus that about y.
            found.append(strain[0] - gauge.distance * (normal[0] * strain[5] - normal[1] * strain[4]))
        return found

    def elastic_energy(self, coordinates: Callable[[int], Array]) -> float:
        nodes = [coordinates(node) for node in self.nodes]
        stiffness = np.diag(np.asarray(_section(self.beam).stiffnessMatrix))
        strains = [self._element_strain(*pair) for pair in pairwise(nodes)]
        return float(sum(0.5 * self._h * stiffness @ strain**2 for strain in strains))

    def _element_strain(self, first: Array, second: Array) -> Array:
        """Stretch, two shears, twist and two curvatures: the screw from node to node over the length, less 1.

        It is the logarithm in SE(3) of the relative motion (Sonneville, Cardona, Brüls, CMAME 268 (2014)
        451-474).
        """
        turn = from_quaternion(first[3:7])
        relative = turn.T @ from_quaternion(second[3:7])
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
        for pair in pairwise(markers):
            mbs.AddObject(
                items.ObjectConnectorRigidBodySpringDamper(markerNumbers=list(pair), damping=damping)
            )

    def grip(self, point: Array, turn: Array) -> Grip:
        node = self.nodes[node_at(self._nodes, point)]
        return RigidGrip((node,), np.zeros(3), self.beam.axes.T)

    def place(self, mbs: Any, origin: Array, turn: Array) -> Place:
        node = self.nodes[node_at(self._nodes, origin)]
        own = self.beam.axes.T @ turn
        marker = mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=node, localHT=held_at(own)))
        return Place(marker, (node,), Seat(0, np.eye(3), np.zeros(3), np.zeros(3), own))


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
    turning = beam.density * np.array([second_y + second_z, second_y, second_z])
    section.massPerLength = per_length
    section.inertia = np.diag(turning)
    return section
