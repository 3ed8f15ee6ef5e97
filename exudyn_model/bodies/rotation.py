"""Rotations as 3 x 3 arrays and unit quaternions (w, x, y, z); all transform body to outer axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "about",
    "cross",
    "from_quaternion",
    "from_rpy",
    "left_product",
    "right_product",
    "rotation_by",
    "skew",
    "to_quaternion",
    "to_rpy",
    "turning_rate",
    "turning_z_to",
]

Array = NDArray[np.float64]

#: Angle [rad] below which a series' first term is exact to rounding where a quotient would cancel.
SMALL_ANGLE = 1e-4


def about(axis: int, angle: float) -> Array:
    """Turn by `angle` [rad] about coordinate axis 0, 1 or 2."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
    return turn


def from_rpy(rpy: Sequence[float]) -> Array:
    """Roll, pitch, yaw [rad] as in URDF: Rz(yaw) Ry(pitch) Rx(roll)."""
    roll, pitch, yaw = rpy
    return about(2, yaw) @ about(1, pitch) @ about(0, roll)


def to_rpy(rotation: Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw [rad] of a rotation, the inverse of `from_rpy`; pitch within a quarter turn."""
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    roll, yaw = np.arctan2(rotation[2, 1], rotation[2, 2]), np.arctan2(rotation[1, 0], rotation[0, 0])
    return float(roll), float(pitch), float(yaw)


def skew(a: Sequence[float] | Array) -> Array:
    """The matrix of ``a x``."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: Array, b: Array) -> Array:
    """a x b of two vectors; NumPy's takes ten times as long over three numbers."""
    (p, q, r), (x, y, z) = a.tolist(), b.tolist()
    return np.array([q * z - r * y, r * x - p * z, p * y - q * x])


def turning_z_to(axis: Array) -> Array:
    """A rotation whose third column is the unit vector `axis`."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])


def to_quaternion(rotation: Array, *, near: Array | None = None) -> Array:
    """Unit quaternion of a rotation; of the two signs the one nearer to `near`, else the one with w >= 0.

    The largest component is found first, so that no small number is divided by (Shepperd 1978).
    """
    r, trace = rotation, float(np.trace(rotation))
    squares = np.array([trace, r[0, 0], r[1, 1], r[2, 2]])
    k = int(np.argmax(squares))
    if k == 0:
        q = np.array([1 + trace, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    else:
        i = k - 1
        j, m = (i + 1) % 3, (i + 2) % 3
        q = np.empty(4)
        q[0] = r[m, j] - r[j, m]
        q[1 + i] = 1 + r[i, i] - r[j, j] - r[m, m]
        q[1 + j] = r[j, i] + r[i, j]
        q[1 + m] = r[m, i] + r[i, m]
    q /= np.linalg.norm(q)
    flip = q @ near < 0 if near is not None else q[0] < 0
    return -q if flip else q


def from_quaternion(e: Array) -> Array:
    """Body to outer axes from a unit quaternion (w, x, y, z), shape (3, 3)."""
    w, x, y, z = e
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def left_product(p: Array) -> Array:
    """The matrix of ``p o`` for quaternions, shape (4, 4)."""
    w, x, y, z = p
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])


def right_product(q: Array) -> Array:
    """The matrix of ``o q`` for quaternions, shape (4, 4)."""
    w, x, y, z = q
    return np.array([[w, -x, -y, -z], [x, w, z, -y], [y, -z, w, x], [z, y, -x, w]])


def rotation_by(vector: Array) -> Array:
    """The rotation about `vector` by its length [rad] (Rodrigues), shape (3, 3)."""
    angle, cross = float(np.linalg.norm(vector)), skew(vector)
    return (
        np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross @ cross
    )


def turning_rate(vector: Array) -> Array:
    """From the rate of a rotation vector to the angular velocity in outer axes, shape (3, 3).

    T = 1 + (1 - cos a)/a^2 r~ + (a - sin a)/a^3 r~ r~ (Géradin, Cardona 2001, eq. 4.26).
    """
    angle, cross = float(np.linalg.norm(vector)), skew(vector)
    third = (angle - np.sin(angle)) / angle**3 if angle > SMALL_ANGLE else 1 / 6
    return np.eye(3) + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross + third * cross @ cross
