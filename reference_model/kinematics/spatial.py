"""Rotations and cross products, for CasADi expressions and for arrays.

Columns are 3 x 1. Quaternions are w, x, y, z and rotate body components into inertial components.
"""

from __future__ import annotations

from collections.abc import Iterable

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "constant",
    "quaternion_from_rpy",
    "quaternion_rate",
    "rotation_about",
    "rotation_from_quaternion",
    "rotation_from_rpy",
    "rows_of",
    "skew",
]

#: Entries of a constant rotation below this are rounding of a right angle; as exact zeros they vanish from
#: every later expression.
ROUNDING = 1e-15

#: Rate at which a quaternion's length is pulled back to one [1/s]. The rotation does not depend on the
#: length, so the value only has to suppress rounding and integration errors.
LENGTH_RATE = 1.0


def constant(array: ArrayLike) -> ca.SX:
    """A constant matrix or column without its zeros, which then vanish from every later expression."""
    return ca.sparsify(ca.SX(np.asarray(array, dtype=float)))


def rows_of(column: ca.SX, rows: Iterable[int]) -> ca.SX:
    """The rows of a column, also when there are none or the column has a single one."""
    return ca.vertcat(ca.SX(0, 1), *(column[row] for row in rows))


def skew(a: ca.SX) -> ca.SX:
    """The matrix a~ with a~ b = a x b, 3 x 3."""
    matrix = ca.SX(3, 3)
    for row, column, source, sign in (
        (0, 1, 2, -1),
        (0, 2, 1, 1),
        (1, 0, 2, 1),
        (1, 2, 0, -1),
        (2, 0, 1, -1),
        (2, 1, 0, 1),
    ):
        if a.sparsity().has_nz(source, 0):
            matrix[row, column] = sign * a[source]
    return matrix


def rotation_about(axis: ArrayLike, angle: ca.SX) -> ca.SX:
    """Rotation by `angle` [rad] about the constant unit `axis`, 3 x 3: a a^T + cos (1 - a a^T) + sin a~."""
    a = np.asarray(axis, dtype=float)
    along = np.outer(a, a)
    return (
        ca.sparsify(ca.SX(along))
        + ca.cos(angle) * ca.sparsify(ca.SX(np.eye(3) - along))
        + ca.sin(angle) * skew(ca.sparsify(ca.SX(a)))
    )


def rotation_from_rpy(rpy: ArrayLike) -> NDArray[np.float64]:
    """Rotation Rz(yaw) Ry(pitch) Rx(roll) of roll, pitch, yaw [rad] as in URDF, 3 x 3."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    matrix = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return np.where(np.abs(matrix) < ROUNDING, 0.0, matrix)


def quaternion_from_rpy(rpy: ArrayLike) -> NDArray[np.float64]:
    """Unit quaternion of roll, pitch, yaw [rad], shape (4,)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(np.asarray(rpy) / 2), np.sin(np.asarray(rpy) / 2)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def rotation_from_quaternion(q: ca.SX) -> ca.SX:
    """Rotation body -> inertial of a quaternion of any length above zero, 3 x 3."""
    w, v = q[0], q[1:4]
    return ca.SX.eye(3) + (2 / ca.dot(q, q)) * (w * skew(v) + skew(v) @ skew(v))


def quaternion_rate(q: ca.SX, angular_velocity: ca.SX) -> ca.SX:
    """dq/dt for the body's angular velocity in body axes [rad/s], 4 x 1.

    q' = 1/2 [-om.v; w om - om x v], plus a pull towards unit length that leaves the rotation alone.
    """
    w, v = q[0], q[1:4]
    turning = ca.vertcat(-ca.dot(angular_velocity, v), w * angular_velocity - ca.cross(angular_velocity, v))
    return turning / 2 + LENGTH_RATE * (1 - ca.dot(q, q)) * q
