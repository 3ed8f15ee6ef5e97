"""The mechanism as an Exudyn system, and the meaning of its coordinates.

A free base hangs on six massless joints: three slides along the inertial axes, then turns about x, y, z
from an anchor attitude. These angles are singular at a quarter turn of the second one; a run therefore stops
well before and continues from a new anchor (`Placement.is_near_its_end`), which is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import cos, sin
from typing import Any

import exudyn
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.mechanism import Mass, Mechanism
from exudyn_model.bodies.rotation import about
from exudyn_model.control.rigid_dynamics import BaseState

__all__ = ["Placement", "RobotState", "System", "build", "coordinates"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
exu: Any = exudyn
items: Any = exudyn.itemInterface

#: Second base angle [rad] beyond which a new anchor is taken; it is singular at pi/2.
ANCHOR_RANGE = 0.7

#: Force on all coordinates from time, coordinates and their rates.
ForceFunction = Callable[[float, Sequence[float], Sequence[float]], list[float]]


@dataclass(frozen=True)
class RobotState:
    """State of the robot, independent of any coordinates of the base.

    Attributes:
        time: [s].
        position, velocity: of the members [rad or m, per s].
        base_rotation: base to inertial axes, shape (3, 3).
        base_position, base_velocity: in the inertial frame [m, m/s], shape (3,).
        base_angular_velocity: in base axes [rad/s], shape (3,).
        motor_position, motor_velocity: of motors with their own coordinate [rad or m, per s].
    """

    time: float
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    base_rotation: Array
    base_position: Array
    base_velocity: Array
    base_angular_velocity: Array
    motor_position: tuple[float, ...] = ()
    motor_velocity: tuple[float, ...] = ()


@dataclass(frozen=True)
class Placement:
    """Conversion from coordinates of the system to the state of the robot.

    Attributes:
        free: the first six coordinates are the base's.
        anchor: attitude at zero base angles, shape (3, 3).
        position: of a fixed base [m], shape (3,).
        motors: number of motor coordinates, which are the last ones.
    """

    free: bool
    anchor: Array
    position: Array
    motors: int = 0

    @property
    def base_coordinates(self) -> int:
        return 6 if self.free else 0

    def is_near_its_end(self, coordinates: Sequence[float] | Array) -> bool:
        """Whether the base has rotated so far from the anchor that a new one is needed."""
        return self.free and abs(coordinates[4]) > ANCHOR_RANGE

    def base(self, x: Sequence[float], v: Sequence[float]) -> BaseState:
        """Attitude and angular velocity of the base at coordinates `x` with rates `v`."""
        if not self.free:
            return BaseState(self.anchor, np.zeros(3))
        rotation = self.anchor @ about(0, x[3]) @ about(1, x[4]) @ about(2, x[5])
        (da, db, dc), (sb, cb), (sc, cc) = v[3:6], (sin(x[4]), cos(x[4])), (sin(x[5]), cos(x[5]))
        omega = np.array([cb * cc * da + sc * db, -cb * sc * da + cc * db, sb * da + dc])
        return BaseState(rotation, omega, np.array(x[:3]), np.array(v[:3]))

    def state(self, time: float, x: Sequence[float], v: Sequence[float]) -> RobotState:
        """The robot's state at coordinates `x` with rates `v`."""
        base, first, last = self.base(x, v), self.base_coordinates, len(x) - self.motors
        return RobotState(
            time=time,
            position=tuple(x[first:last]),
            velocity=tuple(v[first:last]),
            motor_position=tuple(x[last:]),
            motor_velocity=tuple(v[last:]),
            base_rotation=base.rotation,
            base_position=np.array(x[:3]) if self.free else self.position,
            base_velocity=np.array(v[:3]) if self.free else np.zeros(3),
            base_angular_velocity=base.angular_velocity,
        )


@dataclass(frozen=True)
class System:
    """An assembled Exudyn system, its placement, and its initial coordinates and rates."""

    mbs: Any
    container: Any
    placement: Placement
    initial: tuple[list[float], list[float]]


def build(
    mechanism: Mechanism, state: RobotState, forces: ForceFunction, motors: Sequence[float] = ()
) -> System:
    """Exudyn system of `mechanism` starting at `state`, driven by `forces` on all coordinates.

    The last coordinates are those of separate motors, of inertias `motors` [kg m^2 or kg].
    """
    placement = Placement(mechanism.free, state.base_rotation, mechanism.base_position, len(motors))
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    x, v = _initial(placement, state)
    nodes = [coordinates(mbs, x, v)]
    on_tree = {} if motors else {"forceUserFunction": lambda _, t, item, q, qd: forces(t, q, qd)}
    mbs.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=nodes[0], gravity=mechanism.gravity, **on_tree, **_tree(mechanism, placement)
        )
    )
    # Reflected rotor inertia acts on the joint coordinates only: a separate mass on the tree's node.
    rotors = _rotors(mechanism, placement.base_coordinates)
    if motors:
        # Forces depend on joints and motors, so they are those of an object on both.
        nodes.append(coordinates(mbs, state.motor_position, state.motor_velocity))
        on_both = {"forceUserFunction": lambda _, t, item, q, qd: forces(t, q, qd)}
        count = len(rotors)
        mass = np.diag([*np.zeros(count), *motors])
        mass[:count, :count] = rotors
        mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=nodes, massMatrix=mass, **on_both))
    elif rotors.any():
        mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=nodes, massMatrix=rotors))
    mbs.Assemble()
    initial = [*x, *state.motor_position], [*v, *state.motor_velocity]
    return System(mbs, container, placement, initial)


def _rotors(mechanism: Mechanism, first: int) -> Array:
    """Mass matrix of the rotors on the tree's coordinates, the members' behind `first` others."""
    matrix = np.diag([0.0] * first + [member.rotor for member in mechanism.members])
    if mechanism.coupled is not None:
        matrix[first:, first:] += mechanism.coupled[np.ix_(mechanism.coordinate, mechanism.coordinate)]
    return matrix


def coordinates(mbs: Any, x: Sequence[float], v: Sequence[float]) -> int:
    """A node with these initial coordinates; their reference values are zero."""
    node = items.NodeGenericODE2(
        referenceCoordinates=[0.0] * len(x),
        initialCoordinates=list(x),
        initialCoordinates_t=list(v),
        numberOfODE2Coordinates=len(x),
    )
    return int(mbs.AddNode(node))


def _initial(placement: Placement, state: RobotState) -> tuple[list[float], list[float]]:
    """Coordinates and rates; at zero angles the angular rates are the angular velocity in base axes."""
    if not placement.free:
        return list(state.position), list(state.velocity)
    x = [*state.base_position, 0.0, 0.0, 0.0, *state.position]
    return x, [*state.base_velocity, *state.base_angular_velocity, *state.velocity]


@dataclass(frozen=True)
class _Link:
    kind: Any
    parent: int
    rotation: Array
    origin: Array
    body: Mass


def _links(mechanism: Mechanism, placement: Placement) -> list[_Link]:
    kinds, still, identity = exu.JointType, np.zeros(3), np.eye(3)
    found: list[_Link] = []
    if placement.free:
        slides = (kinds.PrismaticX, kinds.PrismaticY, kinds.PrismaticZ)
        found += [_Link(kind, k - 1, identity, still, Mass()) for k, kind in enumerate(slides)]
        found.append(_Link(kinds.RevoluteX, 2, placement.anchor, still, Mass()))
        found.append(_Link(kinds.RevoluteY, 3, identity, still, Mass()))
        found.append(_Link(kinds.RevoluteZ, 4, identity, still, mechanism.base))
    first = len(found)
    for member in mechanism.members:
        kind = kinds.RevoluteZ if member.revolute else kinds.PrismaticZ
        link = _Link(kind, member.parent + first, member.rotation, member.origin, member.body)
        if member.parent < 0 and not placement.free:
            origin = placement.position + placement.anchor @ member.origin
            link = replace(link, parent=-1, rotation=placement.anchor @ member.rotation, origin=origin)
        found.append(link)
    return found


def _tree(mechanism: Mechanism, placement: Placement) -> dict[str, Any]:
    links = _links(mechanism, placement)
    return {
        "jointTypes": [link.kind for link in links],
        "linkParents": [link.parent for link in links],
        "jointTransformations": exu.Matrix3DList([link.rotation for link in links]),
        "jointOffsets": exu.Vector3DList([link.origin for link in links]),
        "linkInertiasCOM": exu.Matrix3DList([link.body.central_inertia for link in links]),
        "linkCOMs": exu.Vector3DList([link.body.center for link in links]),
        "linkMasses": [link.body.mass for link in links],
    }
