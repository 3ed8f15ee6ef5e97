"""All forces on the joint coordinates, as one Exudyn object on the bodies' coordinates.

With w_k the row that gives the rate of joint coordinate k from the rates of the bodies' coordinates, torques
tau act as W^T tau, a rotor of reflected inertia I as a mass I w^T w, and a wrench on the base through its
own rows. The rows hold exactly where the joints' constraints do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import atan2, cos, sin
from typing import Any

import exudyn
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.rotation import cross, from_quaternion
from exudyn_model.redundant.bodies.handles import Handle, Seat, euler_rates
from exudyn_model.redundant.bodies.parts import Connection
from exudyn_model.redundant.bodies.rigid import Place

__all__ = ["Drive", "JointMotion", "NearbyFunction"]

Array = NDArray[np.float64]
items: Any = exudyn.itemInterface

#: Step of the forces' derivatives with respect to joint positions and velocities [rad or m, per s]: a small
#: part of the speed over which dry friction changes its sign.
DIFFERENCE = 1e-7


@dataclass(frozen=True)
class JointMotion:
    """The n joints with one coordinate at an instant, followed by m motors with their own coordinate.

    Attributes:
        position, velocity: [rad or m, per s], joints in the order of the file.
        rows: rates of joints and motors per rate of the drive's coordinates, shape (n + m, c).
        extra: accelerations of joints and motors at zero accelerations of the drive's coordinates.
        handles: the two places of every connection.
    """

    position: list[float]
    velocity: list[float]
    rows: Array
    extra: list[float]
    handles: list[tuple[Handle, Handle]]


#: Total force per joint and motor, then maybe the base's wrench; from time, joints, and coordinates' values
#: and rates.
ForceFunction = Callable[[float, JointMotion, Array, Array], Array]
#: From the same, the force per joint at joint positions and velocities close by, for its slopes.
NearbyFunction = Callable[[float, JointMotion, Array, Array], Callable[[JointMotion], Array]]


class Drive:
    """Forces on the joints of a redundant system.

    Args:
        connections: of the robot, with where they hold, one pair of places each.
        order: names of the joints with one coordinate, in the order of the file.
        rotors: mass matrix of the rotors on these and then on the motors with their own coordinate, square
            [kg m^2, kg m or kg].
        motors: node of the latter's coordinates; None without any.
        watched: nodes on which forces depend without acting on them.
        base: node of a free base, whose wrench comes with the forces; None of a fixed one.
    """

    def __init__(
        self,
        connections: Sequence[Connection],
        places: Sequence[tuple[Place, Place]],
        *,
        order: Sequence[str],
        rotors: Array,
        base: int | None,
        motors: int | None = None,
        watched: Sequence[int] = (),
    ) -> None:
        self._moving = [k for k, link in enumerate(connections) if link.joint.name in order]
        self._coordinate = {k: list(order).index(connections[k].joint.name) for k in self._moving}
        self._slides = {k: connections[k].joint.kind == "prismatic" for k in self._moving}
        self._rotors = rotors
        self._base = base
        self.nodes: list[int] = [] if base is None else [base]
        for pair in places:
            for place in pair:
                self.nodes += [node for node in place.nodes if node not in self.nodes]
        self._watched = [*watched]
        self.nodes += [node for node in watched if node not in self.nodes]
        self._count = len(self._rotors)
        self._motors, self.joints = motors, len(order)
        if motors is not None:
            self.nodes.append(motors)
        self._places = places
        self._known: tuple[bytes, JointMotion] = (b"", JointMotion([], [], np.zeros((0, 0)), [], []))
        self.last = [0.0] * len(order)
        for k in self._moving:
            self.last[self._coordinate[k]] = connections[k].joint.initial_position

    def add(self, mbs: Any, forces: ForceFunction, nearby: NearbyFunction | None = None) -> None:
        """Put the drive into the system; before it is assembled. `nearby` is cheaper where it is given."""
        sizes = [len(mbs.GetNode(node)["referenceCoordinates"]) for node in self.nodes]
        starts = dict(zip(self.nodes, np.cumsum([0, *sizes])))
        self.size = int(sum(sizes))
        self._reference = np.concatenate(
            [np.asarray(mbs.GetNode(node)["referenceCoordinates"], dtype=float) for node in self.nodes]
            or [np.zeros(0)]
        )
        self._seats = [tuple(_moved(place, starts) for place in pair) for pair in self._places]
        #: Places of the watched nodes among the drive's coordinates.
        self.watched = [slice(int(starts[node]), int(starts[node]) + n) for node, n in zip(self.nodes, sizes)]
        self.watched = [self.watched[self.nodes.index(node)] for node in self._watched]
        self._forces = forces
        self._nearby = nearby or (lambda t, motion, q, v: lambda moved: forces(t, moved, q, v))
        if not self.nodes:
            return
        functions = {
            "forceUserFunction": lambda _, t, item, q, v: self._force(t, np.array(q), np.array(v)),
            "jacobianUserFunction": lambda _, t, item, q, v, a, b: self._jacobian(
                t, np.array(q), np.array(v), a, b
            ),
        }
        if self._rotors.any():
            functions["massMatrixUserFunction"] = lambda _, t, item, q, v: self._mass(
                np.array(q), np.array(v)
            )
        self.number = mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=self.nodes, **functions))

    def places_of(self, mbs: Any) -> Array:
        """Indices of the drive's coordinates among those of the system; after it is assembled."""
        found = mbs.systemData.GetObjectLTGODE2(self.number) if self.nodes else []
        return np.array(found, dtype=int)

    def motion(self, q: Array, v: Array) -> JointMotion:
        """The joints at displacements `q` from the reference, with rates `v`; the last ones are kept."""
        key = q.tobytes() + v.tobytes()
        if key != self._known[0]:
            self._known = (key, self._motion(q, v))
        return self._known[1]

    def _motion(self, q: Array, v: Array) -> JointMotion:
        x = q + self._reference
        count = self._count
        position, velocity, extra = [0.0] * count, [0.0] * count, [0.0] * count
        rows = np.zeros((count, self.size))
        for i in range(self.joints, count):
            place = self.size - count + i
            rows[i, place], position[i], velocity[i] = 1.0, float(x[place]), float(v[place])
        handles = [(Handle.at(outer, x, v), Handle.at(inner, x, v)) for outer, inner in self._seats]
        for k in self._moving:
            i, (outer, inner) = self._coordinate[k], handles[k]
            if self._slides[k]:
                position[i], extra[i] = _slide(outer, inner, rows[i])
            else:
                position[i] = _turn(outer, inner, rows[i], self.last[i])
            velocity[i] = float(rows[i] @ v)
        return JointMotion(position, velocity, rows, extra, handles)

    def whole(self, q: Array) -> Array:
        """Coordinates with their reference values."""
        coordinates: Array = q + self._reference
        return coordinates

    def spread(self, motion: JointMotion, q: Array, forces: Array) -> Array:
        """Generalised forces of forces on joints and motors, and of a wrench on the base."""
        count = self._count
        total: Array = motion.rows.T @ forces[:count]
        if len(forces) > count:
            # Force and moment in base axes, on the base's seven coordinates.
            e = self.whole(q)[3:7]
            total[:3] += from_quaternion(e) @ forces[count : count + 3]
            total[3:7] += euler_rates(e).T @ forces[count + 3 :]
        return total

    def _force(self, time: float, q: Array, v: Array) -> Array:
        motion = self.motion(q, v)
        given = self._forces(time, motion, q, v)
        given[: self._count] -= self._rotors @ motion.extra
        return self.spread(motion, q, given)

    def _mass(self, q: Array, v: Array) -> Array:
        return self.reflected(self.motion(q, v))

    def reflected(self, motion: JointMotion) -> Array:
        """Mass matrix of the rotors on the drive's coordinates."""
        matrix: Array = motion.rows.T @ self._rotors @ motion.rows
        return matrix

    def _jacobian(self, time: float, q: Array, v: Array, by_position: float, by_velocity: float) -> Array:
        """Of minus the forces; their dependence on the joint coordinates only, which is the stiff part."""
        motion, count = self.motion(q, v), self._count
        near = self._nearby(time, motion, q, v)
        given = near(motion)[:count]
        slopes = np.zeros((count, count))
        for i in range(count):
            for moved, weight in (
                (replace(motion, position=_shifted(motion.position, i)), by_position),
                (replace(motion, velocity=_shifted(motion.velocity, i)), by_velocity),
            ):
                slopes[:, i] += weight * (near(moved)[:count] - given) / DIFFERENCE
        matrix: Array = -motion.rows.T @ slopes @ motion.rows
        return matrix


def _shifted(values: list[float], index: int) -> list[float]:
    moved = list(values)
    moved[index] += DIFFERENCE
    return moved


def _moved(place: Place, starts: dict[int, int]) -> Seat:
    """The seat with its coordinates where the drive has them."""
    if not place.nodes:
        return place.seat
    return replace(place.seat, rigid=int(starts[place.nodes[0]]))


def _turn(outer: Handle, inner: Handle, row: Array, last: float) -> float:
    """Angle about the joint's z axis, next to `last`; fills the row."""
    axis = inner.joint[:, 2]
    relative = outer.joint.T @ inner.joint[:, 0]
    angle = atan2(relative[1], relative[0])
    angle = last + atan2(sin(angle - last), cos(angle - last))
    inner.row_of_turn(axis, row)
    taken = np.zeros_like(row)
    outer.row_of_turn(outer.joint[:, 2], taken)
    row -= taken
    return angle


def _slide(outer: Handle, inner: Handle, row: Array) -> tuple[float, float]:
    """Distance along the outer body's z axis; fills the row.

    With d = s H: sdd = H . dd + s |omega x H|^2, omega of the outer body.
    """
    axis, apart = outer.joint[:, 2], inner.point - outer.point
    inner.row_of_slide(axis, np.zeros(3), row)
    taken = np.zeros_like(row)
    outer.row_of_slide(axis, apart, taken)
    row -= taken
    position = float(axis @ apart)
    swing = cross(outer.spin, axis)
    return position, float(axis @ (inner.pull() - outer.pull()) + position * (swing @ swing))
