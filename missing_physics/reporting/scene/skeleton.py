"""The robot as lines and boxes, and its pose over time: for drawing only.

It has its own forward kinematics and needs neither engine. All values are in m and in the inertial frame
unless stated otherwise; a rotation matrix maps a body's coordinates into that frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from missing_physics.reporting.scene.deflection import held_by, tip_of
from robot_model import Inertial, Joint, Link, Robot

__all__ = ["BodyShape", "Poses", "body_shapes", "poses", "reach"]

Array = NDArray[np.float64]

#: Half width of a drawn link as a fraction of the robot's size, if its inertia gives no estimate.
SLIMMEST = 0.012
WIDEST = 0.12
#: The same for a body of unknown size.
PLAIN = 0.08


@dataclass(frozen=True)
class Poses:
    """Pose of one body at N instants: `translation` (N, 3) [m] of its frame, `rotation` (N, 3, 3)."""

    translation: Array
    rotation: Array

    @property
    def quaternion(self) -> Array:
        """Unit quaternions x, y, z, w, shape (N, 4)."""
        return np.asarray(Rotation.from_matrix(self.rotation).as_quat())


@dataclass(frozen=True)
class BodyShape:
    """How one body is drawn, in its own frame.

    Attributes:
        lines: from its frame's origin to its centre of mass and to every outboard joint, and the rails of
            outboard prismatic joints, each (2, 3) [m].
        centre: of the box [m].
        half_size: of the box of equal inertia, kept between limits that can be seen [m].
        quaternion: x, y, z, w of the box's axes.
    """

    lines: tuple[Array, ...]
    centre: Array
    half_size: Array
    quaternion: Array


def reach(robot: Robot) -> float:
    """Length of the longest chain of the robot, stretched out [m]; at least 0.1 m."""
    length = {"base": 0.0}
    for joint in robot.tree:
        stroke = (
            max(abs(x) for x in joint.position_limits) if _slides(joint) and joint.position_limits else 0.0
        )
        length[joint.child] = length[joint.parent] + float(np.linalg.norm(joint.origin)) + stroke
    tips = [length[link.name] + float(np.linalg.norm(_far_end(link))) for link in robot.links]
    return max(0.1, *tips)


def body_shapes(robot: Robot) -> Mapping[str, BodyShape]:
    """Body name (`base` included) to how it is drawn."""
    size = reach(robot)
    bodies: dict[str, Inertial] = {"base": robot.base, **{link.name: link for link in robot.links}}
    return {name: _shape(robot, name, body, size) for name, body in bodies.items()}


def poses(
    robot: Robot,
    positions: Mapping[str, Array],
    *,
    base: Poses | None = None,
    attitudes: Mapping[str, Array] | None = None,
    deflections: Mapping[str, Array] | None = None,
) -> Mapping[str, Poses]:
    """Body name (`base` included) to its poses at N instants.

    Args:
        robot: the robot.
        positions: joint name to its positions, all of shape (N,) [rad or m]; other moving joints stay at
        their
            initial positions.
        base: poses of a free base; its initial pose when None.
        attitudes: of spherical joints, child to joint axes, shape (N, 3, 3); identity by default.
        deflections: of the tips of flexible links as drawn, shape (N, 3) [m]; attached bodies move with them.
    """
    count = max([values.size for values in positions.values()] + [len(base.translation) if base else 1])
    still = Poses(
        np.tile(np.asarray(robot.base.position, dtype=float), (count, 1)),
        np.tile(_rotation(robot.base.rpy), (count, 1, 1)),
    )
    found = {"base": base or still}
    for joint in robot.tree:
        turn = (attitudes or {}).get(joint.name)
        if turn is None:
            values = np.broadcast_to(positions.get(joint.name, np.array(joint.initial_position)), (count,))
            turn = _turn(joint, values)
        else:
            values = np.zeros(count)
        parent = found[joint.parent]
        moved = (deflections or {}).get(joint.parent)
        origin = np.asarray(joint.origin, dtype=float)
        if moved is not None:
            shift, tilt = held_by(robot.link(joint.parent), origin, moved)
            parent = Poses(
                parent.translation + np.einsum("nij,nj->ni", parent.rotation, origin + shift - tilt @ origin),
                parent.rotation @ tilt,
            )
        found[joint.child] = _outboard(parent, joint, values, turn)
    return found


def _outboard(parent: Poses, joint: Joint, values: Array, turn: Array) -> Poses:
    """Parent frame -> (origin, rpy) -> motion of the joint -> frame of the child."""
    frame = parent.rotation @ _rotation(joint.rpy)
    origin = parent.translation + parent.rotation @ np.asarray(joint.origin, dtype=float)
    if _slides(joint):
        return Poses(origin + values[:, None] * (frame @ joint.unit_axis), frame)
    return Poses(origin, frame @ turn)


def _turn(joint: Joint, values: Array) -> Array:
    """Rotation of a joint's child at positions `values`, shape (N, 3, 3)."""
    if joint.kind != "revolute":
        return np.tile(np.eye(3), (values.size, 1, 1))
    return np.asarray(Rotation.from_rotvec(values[:, None] * joint.unit_axis).as_matrix())


def _far_end(link: Link) -> Array:
    """The farthest drawn point of a link except its joints, in its frame [m], shape (3,)."""
    return tip_of(link) if link.flexible else np.asarray(link.center_of_mass, dtype=float)


def _shape(robot: Robot, name: str, body: Inertial, size: float) -> BodyShape:
    centre = np.asarray(body.center_of_mass, dtype=float)
    outboard = [joint for joint in robot.joints if joint.parent == name]
    # A flexible link is drawn as a separate bent line that includes its joints.
    flexible = isinstance(body, Link) and body.flexible
    ends = () if flexible else (centre, *(np.asarray(joint.origin) for joint in outboard))
    arms = [np.array([np.zeros(3), end]) for end in ends]
    rails = [_rail(joint, size) for joint in outboard if _slides(joint)]
    lines = tuple(line for line in (*arms, *rails) if np.linalg.norm(line[1] - line[0]) > 1e-9)
    half, axes = _equal_box(body)
    if not half.any():
        half = np.full(3, (SLIMMEST if flexible else PLAIN) * size)
    limits = (SLIMMEST * size, WIDEST * size if name == "base" else size)
    return BodyShape(lines, centre, np.clip(half, *limits), np.asarray(Rotation.from_matrix(axes).as_quat()))


def _rail(joint: Joint, size: float) -> Array:
    """Rail of a prismatic joint, in its parent's frame [m], shape (2, 3)."""
    low, high = joint.position_limits or (-size / 2, size / 2)
    along = _rotation(joint.rpy) @ joint.unit_axis
    return np.asarray(joint.origin) + np.outer([low, high], along)


def _equal_box(body: Inertial) -> tuple[Array, Array]:
    """Half sizes [m] and axes (3, 3) of the homogeneous box with the same mass and inertia.

    A box of half sizes a, b, c has the moment m (b^2 + c^2) / 3 about its first axis, and so on.
    """
    if body.mass <= 0:
        return np.zeros(3), np.eye(3)
    moments, axes = np.linalg.eigh(body.inertia_matrix)
    squares = 1.5 * (moments.sum() - 2 * moments) / body.mass
    axes[:, 2] *= np.sign(np.linalg.det(axes)) or 1.0
    return np.sqrt(np.maximum(squares, 0.0)), axes


def _rotation(rpy: tuple[float, float, float]) -> Array:
    """Roll, pitch, yaw about the fixed x, y, z axes, as in URDF; shape (3, 3)."""
    return np.asarray(Rotation.from_euler("xyz", rpy).as_matrix())


def _slides(joint: Joint) -> bool:
    return joint.kind == "prismatic"
