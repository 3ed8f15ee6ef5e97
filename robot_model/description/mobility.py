"""Whether every coordinate of a robot moves some inertia: whether its mass matrix is regular.

The articulated-body inertias (Featherstone, Rigid Body Dynamics Algorithms, 2008, eq. 7.23-7.25) are computed
from the tips to the base in a pose without symmetry. A pivot that vanishes there vanishes in every pose,
except for a set of measure zero, so that the result holds for the robot and not only for that pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from robot_model.description.types import Inertial, Joint, Robot

__all__ = ["idle_coordinate"]

Matrix = NDArray[np.float64]

#: A pivot below this fraction of all inertia outboard of it is rounding error. Rounding is about 1e-15 of it;
#: the roll inertia of a rod 10 m long and 2 mm thick is 1e-8 of it.
ROUNDING = 1e-12

#: Substitute centre of mass of a body whose own is not known here, on no axis of symmetry [m].
SOMEWHERE = np.array([0.31, 0.17, 0.23])

#: Golden section: multiples of it, folded to one turn, fall on no symmetric pose.
GOLDEN = 0.6180339887498949


def idle_coordinate(robot: Robot) -> str | None:
    """Name of a joint (or ``base``) that can move without moving inertia; None when there is none."""
    bodies = {"base": robot.base, **{link.name: link for link in robot.links}}
    outboard = {name: _alone(body) for name, body in bodies.items()}
    rotors = _rotors(robot)
    for index, joint in reversed(tuple(enumerate(robot.tree))):
        carried = outboard[joint.child]
        seen = carried.inertia
        if joint.kind != "fixed":
            motion = _motion(joint)
            push = seen @ motion
            felt = motion.T @ push
            small = ROUNDING * (carried.mass if joint.kind == "prismatic" else carried.moment)
            if float(np.linalg.eigvalsh(felt)[0]) <= small:
                if rotors.get(joint.name, 0.0) <= 0:
                    return joint.name
                felt = np.zeros_like(felt)
            seen = seen - push @ np.linalg.solve(
                felt + rotors.get(joint.name, 0.0) * np.eye(len(felt)), push.T
            )
        transform = _to_child(joint, 2 * np.pi * ((index + 1) * GOLDEN % 1))
        outboard[joint.parent] = outboard[joint.parent].joined(carried.carried_by(seen, transform))
    return "base" if robot.base.kind == "free" and _turns_freely(outboard["base"]) else None


def _rotors(robot: Robot) -> dict[str, float]:
    """Moving joint to the reflected rotor inertia for its motion alone [kg m^2 or kg]."""
    reflected = np.array([drive.reflected_inertia for drive in robot.drives])
    felt = reflected @ robot.coupling**2  # the diagonal of C^T B C
    return {joint.name: float(value) for joint, value in zip(robot.moving_joints, felt)}


def _motion(joint: Joint) -> Matrix:
    """Joint motions [linear; angular] in the link's frame as columns, shape (6, 1) or (6, 3)."""
    if joint.kind == "spherical":
        return np.vstack([np.zeros((3, 3)), np.eye(3)])
    still = np.zeros(3)
    parts = (still, joint.unit_axis) if joint.kind == "revolute" else (joint.unit_axis, still)
    return np.concatenate(parts)[:, None]


@dataclass(frozen=True)
class _Outboard:
    """A body with all its outboard bodies, at its frame.

    Attributes:
        inertia: articulated-body inertia [linear; angular], shape (6, 6).
        mass: sum of m over all mass points, with d the distance to each along the links [kg].
        lever: upper bound of the sum of m d [kg m].
        moment: upper bound of the sum of m d^2, thus of the moments of inertia, without cancellation, so that
            the rounding errors of `inertia` are small compared with it [kg m^2].
    """

    inertia: Matrix
    mass: float
    lever: float
    moment: float

    def joined(self, other: _Outboard) -> _Outboard:
        """Sum of both, at one frame."""
        return _Outboard(
            self.inertia + other.inertia,
            self.mass + other.mass,
            self.lever + other.lever,
            self.moment + other.moment,
        )

    def carried_by(self, seen: Matrix, transform: Matrix) -> _Outboard:
        """The part `seen` of the inertia that is felt through the joint, at the parent's frame."""
        way = float(np.linalg.norm(transform[:3, 3:])) / np.sqrt(2)  # |a~| = sqrt(2) |a| by Frobenius
        return _Outboard(
            transform.T @ seen @ transform,
            self.mass,
            self.lever + self.mass * way,
            self.moment + 2 * self.lever * way + self.mass * way**2,
        )


def _alone(body: Inertial) -> _Outboard:
    inertia = _spatial_inertia(body)
    moment = float(np.trace(inertia[3:, 3:]))
    mass = float(inertia[0, 0])
    return _Outboard(inertia, mass, np.sqrt(mass * moment), moment)  # Cauchy and Schwarz


def _turns_freely(base: _Outboard) -> bool:
    """Whether the free base, its translation eliminated, has a direction of rotation without inertia."""
    linear, mixed, angular = base.inertia[:3, :3], base.inertia[3:, :3], base.inertia[3:, 3:]
    central = angular - mixed @ np.linalg.pinv(linear, hermitian=True) @ mixed.T
    return bool(np.linalg.eigvalsh(central)[0] <= ROUNDING * base.moment)


def _spatial_inertia(body: Inertial) -> Matrix:
    """Spatial inertia [linear; angular] about the frame's origin, shape (6, 6); a beam's is undeformed.

    The mass of a modal body is in its own file; only that it has mass and moments of inertia is used.
    """
    hub = _point(body.mass, np.asarray(body.center_of_mass), body.inertia_matrix)
    if getattr(body, "modal", None) is not None:
        return hub + _point(1.0, SOMEWHERE, np.eye(3))
    if sprung := getattr(body, "sprung", None):
        return hub + _point(sprung.mass, np.zeros(3), np.zeros((3, 3)))
    beam = getattr(body, "beam", None)
    if beam is None:
        return hub
    tip = _point(beam.tip.mass, beam.nodes[-1], beam.axes @ np.diag(beam.tip.inertia) @ beam.axes.T)
    polar = beam.density * beam.length * sum(beam.section.figures[2:])
    bar = np.diag([polar, *[beam.mass * beam.length**2 / 12] * 2])
    middle = (beam.nodes[0] + beam.nodes[-1]) / 2
    return hub + tip + _point(beam.mass, middle, beam.axes @ bar @ beam.axes.T)


def _point(mass: float, place: Matrix, inertia: Matrix) -> Matrix:
    """Spatial inertia of a body of this mass, centre of mass and central inertia, shape (6, 6)."""
    arm = _cross(place)
    lever = mass * arm
    return np.block([[mass * np.eye(3), -lever], [lever, inertia - lever @ arm]])


def _to_child(joint: Joint, amount: float) -> Matrix:
    """Velocity [linear; angular] of the parent's frame to that of the child's, shape (6, 6)."""
    axis, turned, moved = joint.unit_axis, np.eye(3), np.zeros(3)
    if joint.kind == "revolute":
        turned = _rotation(axis, amount)
    elif joint.kind == "spherical":
        turned = _from_rpy((amount, 2 * amount, 3 * amount))
    elif joint.kind == "prismatic":
        moved = axis * amount
    fixed = _from_rpy(joint.rpy)
    arm = np.asarray(joint.origin) + fixed @ moved
    to_child = (fixed @ turned).T
    return np.block([[to_child, -to_child @ _cross(arm)], [np.zeros((3, 3)), to_child]])


def _cross(vector: Matrix) -> Matrix:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _rotation(axis: Matrix, angle: float) -> Matrix:
    """Rodrigues' formula for a unit axis."""
    cross = _cross(axis)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _from_rpy(rpy: tuple[float, float, float]) -> Matrix:
    """Fixed-axis roll, pitch, yaw, as in URDF: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    roll, pitch, yaw = (_rotation(axis, angle) for axis, angle in zip(np.eye(3), rpy))
    return yaw @ pitch @ roll
