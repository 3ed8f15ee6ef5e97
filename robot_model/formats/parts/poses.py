"""Poses of one frame in another: position and rotation, in the conventions of URDF and MJCF."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["IDENTITY", "Pose", "about", "from_quaternion", "from_rpy", "rpy_of", "shifted"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pose:
    """A frame relative to another one.

    Attributes:
        place: origin in the outer frame [m], shape (3,).
        rotation: axes as columns in the outer frame, shape (3, 3).
        rpy: the angles of the rotation [rad] as given by a file; they are kept, so that an unchanged frame
            keeps the digits of its file.
    """

    place: Array
    rotation: Array
    rpy: tuple[float, float, float] | None = None

    def __matmul__(self, inner: Pose) -> Pose:
        """`inner`, given relative to this frame, relative to the outer one."""
        if self is IDENTITY:
            return inner
        if inner is IDENTITY:
            return self
        turned = bool(np.any(inner.rotation != np.eye(3)))
        return Pose(
            self.place + self.rotation @ inner.place,
            self.rotation @ inner.rotation if turned else self.rotation,
            None if turned else self.rpy,
        )

    @property
    def angles(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw [rad] about fixed axes."""
        return self.rpy or rpy_of(self.rotation)


IDENTITY = Pose(np.zeros(3), np.eye(3), (0.0, 0.0, 0.0))


def shifted(place: ArrayLike) -> Pose:
    """A translated frame with the same axes."""
    return Pose(np.asarray(place, dtype=float), np.eye(3), (0.0, 0.0, 0.0))


def about(axis: ArrayLike, angle: float) -> Array:
    """Rotation by `angle` [rad] about a unit axis, Rodrigues' formula, shape (3, 3)."""
    x, y, z = np.asarray(axis, dtype=float)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def from_rpy(rpy: ArrayLike) -> Array:
    """Roll, pitch, yaw about fixed axes, as in URDF: R = Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3)."""
    roll, pitch, yaw = (
        about(axis, float(angle)) for axis, angle in zip(np.eye(3), np.asarray(rpy, dtype=float))
    )
    return yaw @ pitch @ roll


def from_quaternion(quaternion: ArrayLike) -> Array:
    """Rotation of a quaternion w, x, y, z of any length but zero, shape (3, 3)."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rpy_of(rotation: Array) -> tuple[float, float, float]:
    """Roll, pitch and yaw [rad] of a rotation, exact to rounding at every pitch.

    Yaw is computed first; roll and pitch then follow from the rotation without it. Where the pitch is a right
    angle the yaw is arbitrary, and the roll compensates for the choice.
    """
    r = rotation
    yaw = float(np.arctan2(r[1, 0], r[0, 0]))
    sine, cosine = np.sin(yaw), np.cos(yaw)
    pitch = float(np.arctan2(-r[2, 0], cosine * r[0, 0] + sine * r[1, 0]))
    roll = float(np.arctan2(sine * r[0, 2] - cosine * r[1, 2], cosine * r[1, 1] - sine * r[0, 1]))
    return roll, pitch, yaw
