"""Joint attachment points of bodies: pose and velocity as functions of Exudyn's coordinates.

Attitudes are Euler parameters e, |e| = 1; with G(e) the angular velocity in body axes is G ed, and G edd its
derivative, since Gd ed = 0 (Nikravesh, Computer-Aided Analysis of Mechanical Systems, 1988, ch. 6).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.rotation import cross, from_quaternion, to_quaternion

__all__ = ["Handle", "Seat", "euler_rates", "node_coordinates", "omega_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Seat:
    """A point of a body at a joint.

    Attributes:
        rigid: first of the seven coordinates of the body's frame in the drive's vector; None on the ground.
        rotation, position: of the ground's frame, where `rigid` is None.
        lever: the point in the body's frame [m], shape (3,).
        turn: the joint's axes in the body's frame, shape (3, 3).
    """

    rigid: int | None
    rotation: Array
    position: Array
    lever: Array
    turn: Array


@dataclass(frozen=True)
class Handle:
    """A seat in motion.

    Attributes:
        seat: what it is of.
        body: the body's axes in the inertial frame, shape (3, 3).
        joint: the joint's axes in the inertial frame, shape (3, 3).
        point: the held point, inertial frame [m], shape (3,).
        rates: from the Euler parameters' rates to the angular velocity, shape (3, 4); None on the ground.
        omega: angular velocity in the body's axes [rad/s].
    """

    seat: Seat
    body: Array
    joint: Array
    point: Array
    rates: Array | None
    omega: Array

    @classmethod
    def at(cls, seat: Seat, x: Array, v: Array) -> Handle:
        """The seat at coordinates `x` with rates `v`."""
        if seat.rigid is None:
            point = seat.position + seat.rotation @ seat.lever
            return cls(seat, seat.rotation, seat.rotation @ seat.turn, point, None, np.zeros(3))
        i = seat.rigid
        e = x[i + 3 : i + 7]
        body, rates = from_quaternion(e), euler_rates(e)
        point = x[i : i + 3] + body @ seat.lever
        return cls(seat, body, body @ seat.turn, point, rates, rates @ v[i + 3 : i + 7])

    @property
    def spin(self) -> Array:
        """Angular velocity in inertial axes [rad/s]."""
        turning: Array = self.body @ self.omega
        return turning

    def row_of_turn(self, axis: Array, row: Array) -> None:
        """Add to `row` the part of the coordinates in the angular velocity about `axis` (inertial axes)."""
        if self.rates is None or self.seat.rigid is None:
            return
        i = self.seat.rigid
        row[i + 3 : i + 7] += (self.body.T @ axis) @ self.rates

    def row_of_slide(self, axis: Array, beyond: Array, row: Array) -> None:
        """Add to `row` that for the velocity along `axis` of a body point at offset `beyond` (inertial)."""
        if self.rates is None or self.seat.rigid is None:
            return
        i, own, far = self.seat.rigid, self.body.T @ axis, self.body.T @ beyond
        row[i : i + 3] += axis
        row[i + 3 : i + 7] += cross(self.seat.lever + far, own) @ self.rates

    def pull(self) -> Array:
        """Acceleration of the point at zero accelerations of the coordinates, inertial axes [m/s^2]."""
        pulled: Array = self.body @ cross(self.omega, cross(self.omega, self.seat.lever))
        return pulled


def euler_rates(e: Array) -> Array:
    """G: angular velocity in body axes per rate of the Euler parameters, shape (3, 4)."""
    w, x, y, z = e
    return 2 * np.array([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])


def omega_of(x: Array, v: Array) -> Array:
    """Angular velocity in body axes of a rigid body's seven coordinates and rates [rad/s]."""
    omega: Array = euler_rates(x[3:7]) @ v[3:7]
    return omega


def node_coordinates(rotation: Array, position: Array, velocity: Array, omega: Array) -> tuple[Array, Array]:
    """Seven coordinates of a node with Euler parameters, and their rates."""
    e = to_quaternion(rotation)
    return np.concatenate([position, e]), np.concatenate([velocity, 0.25 * euler_rates(e).T @ omega])
