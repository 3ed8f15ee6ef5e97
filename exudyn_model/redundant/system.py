"""The robot as bodies and constraints in Exudyn, and what its coordinates mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from exudyn_model.bodies.rotation import from_rpy
from exudyn_model.bodies.transmissions import Transmissions
from exudyn_model.effects import Effects
from exudyn_model.effects.links.pushes import Push
from exudyn_model.redundant.bodies.exact_beam import ExactBeam
from exudyn_model.redundant.bodies.grip import Gripped, add_push
from exudyn_model.redundant.bodies.modal_body import ModalBody
from exudyn_model.redundant.bodies.parts import Bending, Connection, Part, Pose, initial_poses, parts_of
from exudyn_model.redundant.bodies.rigid import Body, Ground, RigidBody
from exudyn_model.redundant.drive import Drive, ForceFunction, NearbyFunction
from exudyn_model.solve.system import coordinates
from robot_model import Robot

__all__ = ["System", "build", "rows_of"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
exu: Any = exudyn
items: Any = exudyn.itemInterface

#: Locked translations and rotations about the joint's axes, by kind of joint; z is the joint's axis.
LOCKED = {
    "revolute": (1, 1, 1, 1, 1, 0),
    "prismatic": (1, 1, 0, 1, 1, 1),
    "spherical": (1, 1, 1, 0, 0, 0),
    "fixed": (1, 1, 1, 1, 1, 1),
}


#: Five-point central difference: exact for polynomials up to the fourth degree, such as the rows of the
#: constraints along a line of the coordinates (products of four Euler parameters at most).
STENCIL = ((-2.0, 1 / 12), (-1.0, -8 / 12), (1.0, 8 / 12), (2.0, -1 / 12))
#: Length of its step in units of the coordinates: large, so that nothing cancels.
STRIDE = 0.25


@dataclass(frozen=True)
class System:
    """An assembled system.

    Attributes:
        mbs, container: Exudyn's.
        robot: the description.
        parts, connections: its bodies and joints.
        bodies: of the parts.
        joints: Exudyn's constraint of every connection.
        constraints: first Lagrange multiplier of each.
        drive: forces on the joints.
        driven: indices of the drive's coordinates among those of the system.
        frames: coordinates of every body that turns, of a beam every node.
        gravity: inertial frame [m/s^2], shape (3,).
        reference: reference values of all coordinates.
        pushes: force effects on bodies.
        welds: Exudyn's constraints of nodes that move in the frames of modal bodies.
    """

    mbs: Any
    container: Any
    robot: Robot
    parts: tuple[Part, ...]
    connections: tuple[Connection, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Any, ...]
    constraints: tuple[int, ...]
    drive: Drive
    driven: Array
    frames: tuple[slice, ...]
    gravity: Array
    reference: Array
    pushes: tuple[Gripped, ...] = ()
    welds: tuple[Any, ...] = ()

    @property
    def free(self) -> bool:
        """Whether the base floats."""
        return self.robot.base.kind == "free"

    def rows_of(self, node: int) -> slice:
        """Coordinates of a node among those of the system."""
        return rows_of(self.mbs, node)

    def multipliers(self) -> list[Array]:
        """Lagrange multipliers of every connection now, shape (6,) each."""
        every = self.mbs.systemData.GetAECoordinates(copy=False)
        return [every[first : first + 6] for first in self.constraints]

    @property
    def multiplier_places(self) -> Array:
        """Indices of the connections' multipliers, six each, among all."""
        return np.array([first + k for first in self.constraints for k in range(6)], dtype=int)

    def saddle(self, mass: Array) -> Array:
        """[M C^T; C 0] at the present state, C as in `constraint_rows`.

        A multiplier without a constraint, of a free direction, has a unit on the diagonal.
        """
        rows = self.constraint_rows()
        free = np.diag((~rows.any(axis=1)).astype(float))
        return np.block([[mass, rows.T], [rows, free]])

    def constraint_rows(self) -> Array:
        """C of C v = 0 at the present state: six rows of every connection and weld, then one of every frame.

        The last keep the lengths of the frames' Euler parameters.
        """
        kind = exu.ComputeItemType.ConstraintJacobian
        held = (*self.joints, *self.welds)
        rows = np.zeros((6 * len(held) + len(self.frames), len(self.reference)))
        for k, joint in enumerate(held):
            own = np.asarray(self.mbs.ComputeItem(joint, kind))
            rows[6 * k : 6 * k + 6, self.mbs.systemData.GetObjectLTGODE2(joint)] = own
        x = self.mbs.systemData.GetODE2Coordinates() + self.reference
        for k, frame in enumerate(self.frames):
            rows[6 * len(held) + k, frame.start + 3 : frame.start + 7] = 2 * x[frame][3:7]
        return rows

    def constraint_drift(self, x: Array, v: Array) -> Array:
        """The time derivative of C, times v, at displacements `x` and rates `v`; leaves the system at `x`."""
        data, size = self.mbs.systemData, STRIDE / max(1.0, float(np.abs(v).max(initial=0.0)))
        parts = []
        for place, weight in STENCIL:
            data.SetODE2Coordinates(x + place * size * v)
            parts.append(weight / size * (self.constraint_rows() @ v))
        data.SetODE2Coordinates(x)
        found: Array = np.sum(parts, axis=0)
        return found

    def elastic_energy(self, x: Array) -> float:
        """Of all flexible bodies at all coordinates [J]."""
        return sum(body.elastic_energy(lambda node: x[self.rows_of(node)]) for body in self.bodies)


def build(
    robot: Robot,
    effects: Effects,
    forces: ForceFunction,
    *,
    flexible: str,
    base: Pose | None = None,
    bent: Mapping[str, Bending] | None = None,
    motors: Sequence[float] = (),
    nearby: NearbyFunction | None = None,
    watched: Sequence[str] = (),
) -> System:
    """The robot with its effects, driven by `forces`; flexible links "modal" or as exact "beam".

    `base` is the initial state of the base, by default at rest in the nominal pose. `bent` is the initial
    deflection of modal bodies, by name; others must be straight. `motors` are the initial positions of motors
    with their own coordinate, which start with the speed of their joints. `nearby` gives the forces close
    to a state, for their derivatives. `watched` names links on whose modal coordinates they depend.
    """
    parts, connections = parts_of(robot, effects.masses, effects.points, effects.stiffening)
    poses = initial_poses(robot, parts, connections, base=base, bent=bent)
    gravity = np.asarray(robot.gravity, dtype=float) + effects.gravity
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    fixed = robot.base.kind == "fixed"
    bodies = tuple(
        made(
            mbs,
            part,
            pose,
            gravity=gravity,
            flexible=flexible,
            fixed=fixed and k == 0,
            start=(bent or {}).get(part.name),
        )
        for k, (part, pose) in enumerate(zip(parts, poses))
    )
    places, joints = [], []
    for link in connections:
        outer = bodies[link.parent].place(mbs, link.origin, link.rotation @ link.align)
        inner = bodies[link.child].root(mbs, link.align)
        places.append((outer, inner))
        joints.append(
            mbs.AddObject(
                items.ObjectJointGeneric(
                    markerNumbers=[outer.marker, inner.marker],
                    constrainedAxes=LOCKED[link.joint.kind],
                )
            )
        )
    coupling, apart = Transmissions(robot), tuple(effects.gears)
    rotors = block_diag(
        coupling.inertia(robot, apart), np.diag([gear.inertia for gear in effects.gears.values()])
    )
    order = [joint.name for joint in robot.moving_joints]
    floating = next(iter(bodies[0].frames), None)
    begun = coupling.to_motors([joint.initial_velocity for joint in robot.moving_joints])
    speeds = [begun[k] for k in apart]
    node = coordinates(mbs, motors, speeds) if effects.gears else None
    names = [part.name for part in parts]
    seen = [body.modal for name in watched if isinstance(body := bodies[names.index(name)], ModalBody)]
    drive = Drive(connections, places, order=order, rotors=rotors, base=floating, motors=node, watched=seen)
    drive.add(mbs, forces, nearby)
    pushes = tuple(_pushed(mbs, robot, parts, bodies, at, push) for at, push in effects.pushes)
    mbs.Assemble()
    return System(
        mbs,
        container,
        robot,
        parts,
        connections,
        bodies,
        tuple(joints),
        tuple(int(mbs.systemData.GetObjectLTGAE(joint)[0]) for joint in joints),
        drive,
        drive.places_of(mbs),
        tuple(rows_of(mbs, node) for body in bodies for node in body.frames),
        gravity,
        np.array(mbs.systemData.GetODE2Coordinates(exu.ConfigurationType.Reference)),
        tuple(push for push in pushes if push is not None),
        tuple(weld for body in bodies if isinstance(body, ModalBody) for weld in body.welds),
    )


def rows_of(mbs: Any, node: int) -> slice:
    """Coordinates of a node among those of the system."""
    first = int(mbs.GetNodeODE2Index(node))
    return slice(first, first + len(mbs.GetNode(node)["referenceCoordinates"]))


def _pushed(
    mbs: Any, robot: Robot, parts: Sequence[Part], bodies: Sequence[Body], at: str, push: Push
) -> Gripped | None:
    """A push in the system, on the body that a welded link is part of; None on a base that is fixed."""
    names = [part.name for part in parts]
    turn, point = np.eye(3), push.point
    while at not in names:
        joint = next(joint for joint in robot.joints if joint.child == at)
        inward = from_rpy(joint.rpy)
        turn, point, at = inward @ turn, np.asarray(joint.origin) + inward @ point, joint.parent
    grip = bodies[names.index(at)].grip(point, turn)
    return None if grip is None else add_push(mbs, push, grip)


def made(
    mbs: Any,
    part: Part,
    pose: Pose,
    *,
    gravity: Array,
    flexible: str,
    fixed: bool,
    start: Bending | None = None,
) -> Body:
    """The part in the system; `flexible` is "modal" or "beam"."""
    if fixed:
        return Ground(mbs, pose)
    if part.link is None:
        return RigidBody(mbs, part.mass, pose, gravity=gravity)
    if flexible == "beam" and part.link.beam is not None:
        return ExactBeam(mbs, part.link.beam, part.mass, pose, gravity=gravity, points=part.points)
    assert part.flexible is not None
    return ModalBody(mbs, part.flexible, part.mass, pose, gravity=gravity, points=part.points, start=start)
